"""The diagnosis's own measure: Gaussian priors of theta, white noise sigma, amplitudes mu + deviation of each subject."""
from joint import *
from truths import known
SD=np.array([30.,8,6,30,12,3])
def joint_gauss(G,cols,scale,sigma=0.6,between=0.3,iters=15,th0=None,a0=None):
    P=G.P;k=len(scale);A0=cols[:,:,P.rows]; act=np.flatnonzero(np.abs(A0).max((0,2))>0) if k else np.zeros(0,int); Ac=A0[:,act]
    L=P.L; nu=6+k; sdu=np.concatenate([SD,between*scale]); u=np.zeros((L,nu)); a=np.zeros((G.G,k)) if a0 is None else a0.copy()
    if th0 is not None: u[:,:6]=th0
    mu=np.full(G.G,1e-3)
    def ev(u,a,x0,n):
        c=np.zeros((K,len(P.rows))); 
        if k: c[act]=np.einsum("nk,kcn->cn",(a[G.g]+u[:,6:])[P.lane],Ac)
        r=P.at(u[:,:6],c,x0,n)
        E=P.sum((r[1]**2).sum(1))/sigma**2+((u/sdu)**2).sum(1)+P.sum((r[5]/0.2)**2)
        return r,E,np.bincount(G.g,E,G.G)+((a/scale)**2).sum(1)
    r,E,F=ev(u,a,None,8)
    for it in range(iters):
        A=np.einsum("nic,kcn->nik",r[3][:,:,act],Ac) if k else np.zeros((len(P.rows),3,0))
        Z=np.concatenate([r[3][:,:,:6],A],2); y=r[1]
        g=P.sum(np.einsum("nik,ni->nk",Z,y))/sigma**2; H=P.sum(np.einsum("nik,nij->nkj",Z,Z))/sigma**2
        # lane params: u (theta + dev), group: a; Z for u is [T,A], for a is A
        Huu=H+np.diag(1/sdu**2); Huu=Huu*(1+mu[G.g][:,None,None]*np.eye(nu)); gu=g+u/sdu**2; Hua=H[:,:,6:]; Haa=H[:,6:,6:]; ga=g[:,6:]
        S=np.linalg.solve(Huu,np.concatenate([-gu[...,None],Hua],2))
        if k:
            GA=np.zeros((G.G,k)); np.add.at(GA,G.g,ga+np.einsum("lkj,lk->lj",Hua,S[:,:,0])); HA=np.zeros((G.G,k,k)); np.add.at(HA,G.g,Haa-np.einsum("lkj,lki->lji",Hua,S[:,:,1:]))
            GA+=a/scale**2; HA+=np.diag(1/scale**2); HA[:,range(k),range(k)]*=1+mu[:,None]
            da=-np.linalg.solve(HA,GA[...,None])[...,0]
        else: da=np.zeros((G.G,0))
        du=S[:,:,0]-np.einsum("lkj,lj->lk",S[:,:,1:],da[G.g])
        r2,E2,F2=ev(u+du,a+da,r[0].T,3); ok=F2<=F+1e-9; okl=ok[G.g]; okr=okl[P.lane]; gain=np.where(ok,F-F2,0).max()
        mu=np.where(ok,mu*.1,np.maximum(mu*30,1e-2)); u=np.where(okl[:,None],u+du,u); a=np.where(ok[:,None],a+da,a); F=np.where(ok,F2,F)
        r=[np.where(okr.reshape(-1,*[1]*(v.ndim-1)),v2,v) for v,v2 in zip(r,r2)]
        if gain<0.02 and ok.all(): break
    return u,a,F,r
def m1(ms,d,cands,sigma=0.6,between=0.3,G=None):
    G=G or Groups(ms,d,standard_groups(d)); cols=np.concatenate([c.cols for c in cands]) if cands else np.zeros((0,K,len(d.subj))); scale=np.concatenate([c.scale for c in cands]) if cands else np.zeros(0)
    u,a,F,r=joint_gauss(G,cols,scale,sigma,between)
    S=d.S; full=np.full((len(d.subj),6),np.nan)
    rows=[];uu=[];aa=[]
    for m in range(len(d.motions)):
        for s in range(S):
            q=np.flatnonzero((d.subj==s)&(d.mot==m)); l=(m+1)*S+s
            rows.append(q); uu.append(np.tile(u[l,:6],(len(q),1))); aa.append(np.tile(a[m+1]+u[l,6:],(len(q),1)))
    idx=np.concatenate(rows); uu=np.concatenate(uu); aa=np.concatenate(aa)
    c=np.einsum("nk,kcn->cn",aa,cols[:,:,idx]) if cands else np.zeros((K,len(idx)))
    g,_=gap_of(ms,d,uu,c,idx); full[idx]=g
    ins=np.abs(r[0]-G.P.s.T)[G.g[G.P.lane]==0]
    # mean over subjects of each subject's mean
    val=np.mean([full[d.subj==s].mean() for s in range(S)]); insm=ins.mean()
    bysub=[full[d.subj==s].mean() for s in range(S)]
    return insm,val,[np.mean([full[d.subj==s][:,b].mean() for s in range(S)]) for b in (slice(3,6),slice(0,3))],a[0],full,F[0]
if __name__=="__main__":
    d=known("")
    for n in sys.argv[1].split(","):
        ms=Set(n); by={c.name:c for c in library(d,ms)}; G=Groups(ms,d,standard_groups(d))
        for H in ([],["clavicle_frame_bias"],["clavicle_frame_bias","scapula_landmark_bias"],["conoid_strain:posture","scapula_landmark_bias"],["conoid_strain:posture","scapulothoracic_gap:posture"],["ac_translation:posture","scapulothoracic_gap:posture"],["ac_translation:posture","clavicle_frame_bias","scapulothoracic_gap:posture"]):
            t=time.time(); v=m1(ms,d,[by[h] for h in H],G=G); print(n,H,"in %.2f out %.2f (s %.2f c %.2f) F %.0f %.1fs"%(v[0],v[1],*v[2],v[5],time.time()-t),np.round(v[3],1),flush=True)
