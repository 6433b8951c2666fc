"""Is the measured axial rotation of the clavicle a function of the other five angles (an estimate), to rounding?"""
from truths import *
def fingerprint(d):
    """per subject: rms (deg) about a constant of measured axial - the estimate that turns SC+AC (or AC alone) least from a rest
    posture, the least over the subject's own postures as rest."""
    out=[]
    for q in range(d.S):
        r=np.flatnonzero(d.subj==q); s=d.s[:,r]; best=(9e9,)
        rests=r[np.argsort(d.elev[r],kind="stable")][:12]
        for i in rests:
            Rc,Rs=(np.repeat(rot(np.where(np.arange(6)==2,0,d.s[:,i])[k])[...,None] if False else rot(np.where(np.arange(6)==2,0.0,d.s[:,i])[k][:,None]),len(r),axis=2) for k in (slice(0,3),slice(3,6)))
            for nm,zero in (("SC+AC",True),("SC+AC own",False)):
                if not zero: Rc=np.repeat(rot(d.s[:3,i][:,None]),len(r),axis=2)
                e=np.asarray(clavicle_axial_rotation(jnp.asarray(s[:2]/DEG),jnp.asarray(s[3:]/DEG),jnp.asarray(Rc),jnp.asarray(Rs)))*DEG
                v=(s[2]-e); 
                if v.std()<best[0]: best=(v.std(),nm,int(i-r[0]),v.mean())
        out.append(best)
    return out
if __name__=="__main__":
    for sub in ("","a","b","ab","bC","c","bcC"):
        d=known(sub); print(sub or "base",[("%.3f"%b[0],b[1],b[2]) for b in fingerprint(d)])
