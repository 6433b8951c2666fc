from fitE import *
from cands import *

class Groups:
    """groups of lanes that share amplitudes: list of list of (subject, train rows)."""
    def __init__(self,ms,d,groups,weight=None):
        self.P=Problem(ms,d,[l for g in groups for l in g]); self.g=np.repeat(np.arange(len(groups)),[len(g) for g in groups]); self.G=len(groups)
        self.ms,self.d=ms,d
        self.v=np.ones(self.P.L) if weight is None else np.concatenate(weight)
    def joint(self,cols,scale,th0,a0,lam_a=1.0,iters=12,mean=None,fixed=None):
        """minimise sum_lanes E + lam_a |(a-mean)/scale|^2 in each group. cols (k,K,N). th0 (L,6) a0 (G,k)."""
        P=self.P; k=len(scale); A0=cols[:,:,P.rows]  # k,K,n
        act=np.flatnonzero(np.abs(A0).max((0,2))>0); Ac=A0[:,act]
        w=2*W_E/(6*P.n); mean=np.zeros(k) if mean is None else mean
        def ev(th,a,x0,n):
            c=np.zeros((K,len(P.rows))); c[act]=np.einsum("nk,kcn->cn",a[self.g][P.lane],Ac)
            r=P.at(th,c,x0,n); D,gD,HD=P.DJ(th)
            E=D+W_E/(6*P.n)*P.sum((r[1]**2).sum(1))+1e2*P.sum(np.minimum(r[5],1.0)**2*(r[5]>0.05))
            F=np.bincount(self.g,E*self.v,self.G)+lam_a*(((a-mean)/scale)**2).sum(1)
            return r,E,F,gD,HD
        th=np.clip(th0,P.ms.lo,P.ms.hi); a=a0.copy(); mu=np.full(self.G,1e-3)
        r,E,F,gD,HD=ev(th,a,None,8)
        for it in range(iters):
            X=r[3][:,:,:6]; A=np.einsum("nic,kcn->nik",r[3][:,:,act],Ac); y=r[1]
            Z=np.concatenate([X,A],2); 
            g=w[:,None]*P.sum(np.einsum("nik,ni->nk",Z,y)); H=w[:,None,None]*P.sum(np.einsum("nik,nij->nkj",Z,Z))
            g[:,:6]+=gD; H[:,:6,:6]+=HD
            tt=np.einsum("lkk->lk",H[:,:6,:6]); H[:,range(6),range(6)]+=mu[self.g][:,None]*(tt+1e-6)
            lo,hi=P.ms.lo,P.ms.hi
            fixed_=np.zeros((P.L,6),bool); fixd=np.zeros((P.L,6))
            for rep in range(6):
                # eliminate theta with fixed set
                Hm=np.where(fixed_[:,:,None]|fixed_[:,None,:],0,H[:,:6,:6])+np.einsum("lk,kj->lkj",fixed_*1.0,np.eye(6))
                rhs0=np.where(fixed_,fixd,-(g[:,:6]+np.einsum("lkj,lj->lk",H[:,:6,:6],np.where(fixed_,fixd,0))))
                Ht=np.where(fixed_[:,:,None],0,H[:,:6,6:])
                S=np.linalg.solve(Hm,np.concatenate([rhs0[...,None],Ht],2)) # (L,6,1+k): th = S0 - S1 a
                ga=self.v[:,None]*(g[:,6:]+np.einsum("lkj,lk->lj",H[:,:6,6:],S[:,:,0])); Ha=self.v[:,None,None]*(H[:,6:,6:]-np.einsum("lkj,lki->lji",H[:,:6,6:],S[:,:,1:]))
                GA=np.zeros((self.G,k)); np.add.at(GA,self.g,ga); HA=np.zeros((self.G,k,k)); np.add.at(HA,self.g,Ha)
                GA+=2*lam_a*(a-mean)/scale**2; HA+=np.diag(2*lam_a/scale**2)
                HA[:,range(k),range(k)]*=1+mu[:,None]
                da=-np.linalg.solve(HA,GA[...,None])[...,0] if k else np.zeros((self.G,0))
                dth=S[:,:,0]-np.einsum("lkj,lj->lk",S[:,:,1:],da[self.g])
                bad=((th+dth<lo-1e-9)|(th+dth>hi+1e-9))&~fixed_
                if not bad.any(): break
                fixd=np.where(bad,np.where(th+dth<lo,lo-th,hi-th),fixd); fixed_|=bad
            dth=np.clip(th+dth,lo,hi)-th
            r2,E2,F2,gD2,HD2=ev(th+dth,a+da,r[0].T,3)
            ok=F2<=F+1e-9; mu=np.where(ok,mu*0.1,np.maximum(mu*30,1e-2)); okl=ok[self.g]; okr=okl[P.lane]
            gain=np.where(ok,F-F2,0).max()
            th=np.where(okl[:,None],th+dth,th); a=np.where(ok[:,None],a+da,a); F=np.where(ok,F2,F); E=np.where(okl,E2,E)
            gD=np.where(okl[:,None],gD2,gD); HD=np.where(okl[:,None,None],HD2,HD)
            r=[np.where(okr.reshape(-1,*[1]*(v.ndim-1)),v2,v) for v,v2 in zip(r,r2)]
            if gain<1e-3 and ok.all(): break
        return th,a,E,F,r,it

def standard_groups(d,person=False):
    """group 0: everything; group m+1: motion m held out in all subjects. With person: plus (person p, motion m): others without m; """
    groups=[[(s,np.flatnonzero(d.subj==s)) for s in range(d.S)]]; tests=[]
    for m in range(len(d.motions)):
        groups.append([(s,np.flatnonzero((d.subj==s)&(d.mot!=m))) for s in range(d.S)])
    return groups

def heldout_gap(ms,d,groups_obj,th,a,cols):
    """LOMO: group m+1 lanes = subjects. returns per fold (s,m) mean gap 6 angles and per-row gaps."""
    S=d.S; out={}; rows=[];thr=[];ar=[]
    for m in range(len(d.motions)):
        for s in range(S):
            r=np.flatnonzero((d.subj==s)&(d.mot==m))
            if len(r): rows.append(r); thr.append(np.tile(th[(m+1)*S+s],(len(r),1))); ar.append(np.tile(a[m+1],(len(r),1)))
    idx=np.concatenate(rows); thr=np.concatenate(thr); ar=np.concatenate(ar)
    c=np.einsum("nk,kcn->cn",ar,cols[:,:,idx]) if len(ar[0]) else np.zeros((K,len(idx)))
    g,gape=gap_of(ms,d,thr,c,idx)
    full=np.full((len(d.subj),6),np.nan); full[idx]=g
    fm=np.array([full[r].mean(0) for r in rows]); key=[(d.subj[r[0]],d.mot[r[0]]) for r in rows]
    return fm,key,full,gape
