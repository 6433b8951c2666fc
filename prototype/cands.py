"""Candidates: name -> list of columns; a column is a dict channel -> values per row (N,), plus prior scale in its unit."""
from core import *
from motions.rhythm import REST_DEG

@dataclass
class Cand:
    name: str
    cols: np.ndarray      # (k, K, N) channel offset per unit amplitude
    scale: np.ndarray     # (k,)
    sign: np.ndarray = None
    family: str = ""

def posture_terms(d):
    """bone angles from a fixed reference posture, /30 deg; (6,N)."""
    return (d.s-REST_DEG[:,None])/30.0

def elev_terms(d,late=False):
    f=d.elev/150.0; b=4*f*(1-f)
    return np.stack([f**2 if late else f, 0.3*b, 0.2*2*b*(1-2*f)])

def rot(a):  # (3,N) deg -> (3,3,N)
    return np.asarray(rotation_from_cardan(jnp.asarray(a/DEG)))
def vec(R):
    from scipy.spatial.transform import Rotation
    return Rotation.from_matrix(np.moveaxis(R,-1,0)).as_rotvec().T*DEG

def lowest(d):
    """row of the lowest posture of each row's subject (elevation least)"""
    low=np.zeros(len(d.subj),int)
    for s in range(d.S):
        r=np.flatnonzero(d.subj==s); low[r]=r[np.argmin(d.elev[r])]
    return low

ABD=(np.array([0,20,40,60,80,100.]),np.array([0,2.8,5.3,7.9,10.7,13.8]))
FLX=(np.array([0,20,40,60,80,100,120,140.]),np.array([0,6,10,12,14,16,17,20.]))
def skin_size(d):
    """measured lag in deg by elevation; frontal: abduction, others: flexion."""
    out=np.zeros(len(d.elev))
    for i,e in enumerate(d.elev):
        n=d.motions[d.mot[i]]
        t=ABD if "frontal" in n else FLX
        out[i]=np.interp(e,*t)
    return out
def own_way(d):
    """unit rotation vector (scapula frame) from the lowest posture to each posture, (3,N); damped where tiny."""
    R=rot(d.s[3:]); low=lowest(d)
    v=vec(np.einsum("jin,jkn->ikn",R[:,:,low],R)); n=np.linalg.norm(v,axis=0)
    return v/np.maximum(n,3.0), n

def top_way(d):
    """unit rotation vector (scapula frame) from the subject's lowest posture to its highest, (3,N): one a subject."""
    R=rot(d.s[3:]); low=lowest(d); out=np.zeros((3,len(d.elev)))
    for q in range(d.S):
        r=np.flatnonzero(d.subj==q); i0=low[r[0]]; 
        v=vec(np.einsum("jin,jkn->ikn",R[:,:,[i0]*len(r)],R[:,:,r])); up=d.elev[r]>=0.8*d.elev[r].max()
        w=v[:,up].mean(1) if up.any() else v[:,-1]; out[:,r]=(w/np.linalg.norm(w))[:,None]
    return out
def lag_way(d,size,rounds=15):
    """direction of the lag where it lies along the subject's own way from its lowest to its highest postures: w parallel to the
    mean of log(R0' R exp(size w)) over the highest postures (fixed point; the measured way is what the lag has left of it)."""
    R=rot(d.s[3:]); low=lowest(d); out=np.zeros((3,len(d.elev)))
    from scipy.spatial.transform import Rotation
    for q in range(d.S):
        r=np.flatnonzero(d.subj==q); up=r[d.elev[r]>=0.8*d.elev[r].max()]; i0=low[r[0]]
        w=None
        for _ in range(rounds):
            c=np.zeros((3,len(up))) if w is None else w[:,None]*size[up]; c0=np.zeros(3) if w is None else w*size[i0]
            Ru=np.einsum("ijn,jkn->ikn",R[:,:,up],np.moveaxis(Rotation.from_rotvec(c.T/DEG).as_matrix(),0,-1)); R0=R[:,:,i0]@Rotation.from_rotvec(c0/DEG).as_matrix()
            v=vec(np.einsum("ji,jkn->ikn",R0,Ru)).mean(1); w=v/np.linalg.norm(v); w=w if w[2]>0 else -w  # a raised arm turns the scapula laterally
        out[:,r]=w[:,None]
    return out
def motion_way(d):
    """direction of each motion's own rise (lowest to highest posture); the subject's own where the arm is not raised."""
    out=top_way(d).copy(); R=rot(d.s[3:])
    for q in range(d.S):
        for m in range(len(d.motions)):
            r=np.flatnonzero((d.subj==q)&(d.mot==m))
            if len(r) and d.elev[r].max()-d.elev[r].min()>30:
                i0,i1=r[np.argmin(d.elev[r])],r[np.argmax(d.elev[r])]; v=vec(np.einsum("jin,jkn->ikn",R[:,:,[i0]],R[:,:,[i1]]))[:,0]; out[:,r]=(v/np.linalg.norm(v))[:,None]
    return out
def posture_way(d):
    """direction of each posture's own way from the subject's lowest; the motion's where the way is short."""
    w,n=own_way(d); mw=motion_way(d); k=np.clip((n-2)/3,0,1); v=w/np.maximum(np.linalg.norm(w,axis=0),1e-9)*k+mw*(1-k)
    return v/np.linalg.norm(v,axis=0)
def library(d, ms, courses=True):
    N=d.s.shape[1]; out=[]
    one=np.ones(N)
    def const(name,chs,scale,family="number",combos=None):
        cols=[]
        for ch in chs:
            c=np.zeros((K,N))
            for k,v in (ch.items() if isinstance(ch,dict) else [(ch,1.0)]): c[IX[k]]=v
            cols.append(c)
        out.append(Cand(name,np.array(cols),np.broadcast_to(np.asarray(scale,float),(len(chs),)).copy(),None,family))
    const("sc_position",["sc_x","sc_y","sc_z"],10)
    const("conoid_on_clavicle",["cc_x","cc_y","cc_z"],8)
    const("conoid_on_scapula",["cs_x","cs_y","cs_z"],8)
    const("ts_rest_distance",["d_ts"],10)
    const("ai_rest_distance",["d_ai"],10)
    g=ms.girdle
    L=g.ac_mm[0]
    const("clavicle_length",[{"ac_x":L*0.01,"cc_x":g.clavicle_conoid_mm[0]*0.01}],8)
    const("scapula_size",[{"ts_x":g.ts_mm[0]*.01,"ai_x":g.ai_mm[0]*.01,"ai_y":g.ai_mm[1]*.01,"cs_x":g.scapula_conoid_mm[0]*.0075,"cs_y":g.scapula_conoid_mm[1]*.0075,"cs_z":g.scapula_conoid_mm[2]*.0075}],8)
    const("ts_ai_in_scapula",["ts_x","ai_x","ai_y"],6)
    const("thorax_asymmetry",["M_x"],7)
    const("thorax_tilt",["tilt_x","tilt_y","tilt_z"],[6,3.5,3.5])
    const("thorax_shape",["shape"],0.3)
    const("clavicle_frame_bias",["rc_x","rc_y","rc_z"],[25,8,8],"frame")
    const("scapula_landmark_bias",["rs_x","rs_y","rs_z"],7,"frame")
    const("thorax_frame_bias",["rt_x","rt_y","rt_z"],6,"frame")
    def course(name,chs,scale,terms,family,tscale=None):
        cols=[];sc=[]
        for ch,s in zip(chs,np.broadcast_to(scale,(len(chs),))):
            for t in terms:
                c=np.zeros((K,N))
                for k,v in (ch.items() if isinstance(ch,dict) else [(ch,1.0)]): c[IX[k]]=v*t
                cols.append(c); sc.append(s)
        out.append(Cand(name,np.array(cols),np.array(sc,float),None,family))
    if courses:
        e,el=elev_terms(d),elev_terms(d,True); p=posture_terms(d)
        course("scapulothoracic_gap",["d_ts","d_ai"],[5,7],e,"elev")
        course("conoid_strain",["L"],3,el,"elev")
        course("ac_translation",["ac_x","ac_y","ac_z"],[1.5,1.5,4.5],e,"elev")
        course("sc_translation",["sc_x","sc_y","sc_z"],3.3,e,"elev")
        course("clavicle_axial_estimate",["rc_x"],15,el,"elev")
        course("thorax_extension",["rt_x","rt_y","rt_z"],[8,3,3],e,"elev")
        low=lowest(d); rng_={}
        for i,an in enumerate(PA):   # mean over shoulders of the 5-95 % range of each bone angle, deg
            rng_[an]=max(5.0,np.mean([np.ptp(np.percentile(d.s[i,d.subj==q],[5,95])) for q in range(d.S)]))
        def post(name,chs,scale,angles):
            cs=[];sc=[]
            for ch,s in zip(chs,np.broadcast_to(scale,(len(chs),))):
                for an in angles:
                    c=np.zeros((K,N)); c[IX[f"{ch}@{an}"]]=1.0; cs.append(c); sc.append(s*30.0/rng_[an])
            out.append(Cand(name,np.array(cs),np.array(sc,float),None,"post"))
        SC,CL=["sy","sz","sx"],["cy","cz","cx"]
        post("scapulothoracic_gap:posture",["d_ts","d_ai"],[5,7],SC)
        post("conoid_strain:posture",["L"],3,SC)
        post("conoid_strain:clav_posture",["L"],3,CL)
        post("ac_translation:posture",["ac_x","ac_y","ac_z"],[1.5,1.5,4.5],SC)
        post("sc_translation:posture",["sc_x","sc_y","sc_z"],3.3,["cy","cz"])
        post("clavicle_axial:clav_posture",["rc_x"],15,CL)
        post("clavicle_axial:scap_posture",["rc_x"],15,SC)
        post("thorax_extension:posture",["rt_x","rt_y","rt_z"],[8,3,3],["sz"])
        c=np.zeros((1,K,N)); c[0,ROT0+3:ROT0+6]=lag_way(d,skin_size(d))*skin_size(d)
        k=Cand("skin_artefact",c,np.array([0.4]),None,"skin"); k.mean=np.array([1.0]); out.append(k)
    return out
