from search import *
from motions.rhythm import clavicle_axial_rotation
from scipy.spatial.transform import Rotation
def estimated_axial(d,s=None):
    """SC+AC least rotation from each subject's lowest posture (its own clavicle angles y,z and scapula)."""
    s=d.s if s is None else s; out=np.zeros(s.shape[1]); low=lowest(d)
    for q in range(d.S):
        r=np.flatnonzero(d.subj==q); rest=s[:,low[r[0]]]
        Rc,Rs=(jnp.repeat(rotation_from_cardan(jnp.asarray(rest[k]/DEG))[...,None],len(r),axis=2) for k in (slice(3),slice(3,6)))
        out[r]=np.asarray(clavicle_axial_rotation(jnp.asarray(s[:2,r]/DEG),jnp.asarray(s[3:,r]/DEG),Rc,Rs))*DEG
    return out
def cardan(R): # (3,3,N)->deg
    from motions.rotations import cardan_from_rotation
    return np.asarray(cardan_from_rotation(jnp.asarray(R)))*DEG
def lagged(d,s,scale=1.0):
    """scapula turned back along its own way from the lowest posture by the measured size, never more than the way itself."""
    R=rot(s[3:]); low=lowest(d); v=vec(np.einsum("jin,jkn->ikn",R[:,:,low],R)); n=np.linalg.norm(v,axis=0)
    lag=np.minimum(skin_size(d)*scale,n); 
    back=v/np.maximum(n,1e-9)*lag
    out=s.copy(); out[3:]=cardan(np.einsum("ijn,jkn->ikn",R,rot_vec(-back))); return out
def lagged_top(d,s):
    """as scripts/blind_world: constant direction in each motion, from its lowest to its highest posture; the subject's own where a motion does not raise the arm."""
    R=rot(s[3:]); back=np.zeros((3,s.shape[1])); sz=skin_size(d); tw=top_way(replace(d,s=s)); back=tw*sz; out=s.copy(); out[3:]=cardan(np.einsum('ijn,jkn->ikn',R,rot_vec(-back))); return out
    for q in range(d.S):
        for m in range(len(d.motions)):
            r=np.flatnonzero((d.subj==q)&(d.mot==m))
            if not len(r): continue
            w=tw[:,r[0]]
            if d.elev[r].max()-d.elev[r].min()>30:
                i0,i1=r[np.argmin(d.elev[r])],r[np.argmax(d.elev[r])]; v=vec(np.einsum("jin,jkn->ikn",R[:,:,[i0]],R[:,:,[i1]]))[:,0]; w=v/np.linalg.norm(v)
            back[:,r]=w[:,None]*sz[r]
    out=s.copy(); out[3:]=cardan(np.einsum("ijn,jkn->ikn",R,rot_vec(-back))); return out
def rot_vec(v): return np.moveaxis(Rotation.from_rotvec((v/DEG).T).as_matrix(),0,-1)
def known(subset,skin_first=True):
    """subset of 'abc'; order: frame (a), skin (c), then estimate (b) from what is measured."""
    d=load("../shared/motions_aa" if "a" in subset else "../shared/motions")
    s=d.s
    if "c" in subset: s=(lagged if "C" in subset else lagged_top)(d,s)
    if "b" in subset: s=s.copy(); s[2]=estimated_axial(d,s)
    return replace(d,s=s)
def keep(d,subjects):
    m=np.isin(d.subj,subjects); mp={s:i for i,s in enumerate(subjects)}
    pers=[d.person[s] for s in subjects]; ps=sorted(set(pers))
    return Data(d.s[:,m],d.elev[m],d.tau[m],np.array([mp[x] for x in d.subj[m]]),d.mot[m],[d.subjects[s] for s in subjects],d.motions,np.array([ps.index(p) for p in pers]))
if __name__=="__main__":
    d=known("")
    e=estimated_axial(d); 
    for q in range(d.S):
        r=d.subj==q; dif=d.s[2,r]-e[r]; print(d.subjects[q],"const",round(dif.mean(),1),"rms about const",round(dif.std(),2),"sd axial",round(d.s[2,r].std(),2))
    dc=known("c"); print("skin lag applied mean",np.mean(np.linalg.norm(vec(np.einsum('jin,jkn->ikn',rot(d.s[3:]),rot(dc.s[3:]))),axis=0)), "max", np.max(np.linalg.norm(vec(np.einsum('jin,jkn->ikn',rot(d.s[3:]),rot(dc.s[3:]))),axis=0)))
    for m in range(4):
        r=d.mot==m; print(d.motions[m], np.round(np.linalg.norm(vec(np.einsum('jin,jkn->ikn',rot(d.s[3:,r]),rot(dc.s[3:,r]))),axis=0).mean(),1), "own way", np.round(own_way(d)[1][r].mean(),1))
    da=known("a"); 
    v=vec(np.einsum('jin,jkn->ikn',rot(d.s[3:]),rot(da.s[3:]))); print("AA rot", v.mean(1), v.std(1))
    e=estimated_axial(dc); 
    for q in range(d.S):
        r=d.subj==q; dif=d.s[2,r]-e[r]; print("with skin:",d.subjects[q],"const",round(dif.mean(),1),"rms about const",round(dif.std(),2))
