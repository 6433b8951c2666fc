from name import *
d=known("")
for n,Hs in (("breteler_dissection",(["scapulothoracic_gap:posture","ac_translation:posture"],)),("breteler_mri",(["scapulothoracic_gap:posture","ac_translation:posture"],["scapulothoracic_gap:posture","ac_translation:posture","clavicle_frame_bias"])),("R2",(["scapulothoracic_gap:posture","ac_translation:posture"],["ac_translation:posture","scapulothoracic_gap:posture","thorax_tilt","ac_translation"])),("R4",(["scapulothoracic_gap:posture","ac_translation:posture"],)),("R6",(["scapulothoracic_gap:posture","ac_translation:posture"],))):
    ms=get_set(n); D=Beam(ms,d); st=Study(ms,d,"base"); e0=st.fit([]); print(n,"none",summary(e0[2],st.kind))
    for H in Hs:
        e=None
        for i in range(len(H)): 
            Hh=H[:i+1]; e=D.exact(Hh,D.th_none if e is None else e[1],np.concatenate([e[2] if e else np.zeros(0),D.mean[D.span[H[i]]]]),25)
        cs=[D.by[h] for h in H]; th,a,fm,F=st.fit(cs,np.tile(e[1],(st.G.G,1)),np.tile(e[2],(st.G.G,1)),iters=20)
        bound=(np.abs(th[:6]-ms.lo)<1e-6)|(np.abs(th[:6]-ms.hi)<1e-6)
        print("   ",H,"exact",summary(fm,st.kind),"linear",summary(e[3],st.kind),"conoid at bound",bound[:,5].sum(),"F",F,flush=True)
