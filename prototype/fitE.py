from core import *
W_E=10.0
STARTS=np.array([[0.0]*6,[60.,0,0,60.,0,0],[-60.,0,0,-60.,0,0]])

def box_step(H,g,lo,hi,th):
    """minimise g'd + d'Hd/2 with lo<=th+d<=hi; batch first (L,6)."""
    L=len(g); fixed=np.zeros((L,6),bool); d=np.zeros((L,6)); fixd=np.zeros((L,6))
    for it in range(10):
        Hm=np.where(fixed[:,:,None]|fixed[:,None,:],0,H)+np.einsum("lk,kj->lkj",fixed*1.0,np.eye(6))
        rhs=np.where(fixed,fixd,-(g+np.einsum("lkj,lj->lk",H,np.where(fixed,fixd,0))))
        d=np.linalg.solve(Hm,rhs[...,None])[...,0]
        bad=((th+d<lo-1e-12)|(th+d>hi+1e-12))&~fixed
        grad=g+np.einsum("lkj,lj->lk",H,d)
        at_lo=fixed&(np.abs(th+d-lo)<1e-9)&(grad<-1e-9); at_hi=fixed&(np.abs(th+d-hi)<1e-9)&(grad>1e-9)
        rel=(at_lo|at_hi)&(it<5)&~bad.any(1,keepdims=True)
        if not bad.any() and not rel.any(): break
        fixd=np.where(bad,np.where(th+d<lo,lo-th,hi-th),fixd); fixed=(fixed|bad)&~rel
    return d

class Problem:
    """Lanes = (subject, training rows). rows concatenated; lane index per row."""
    def __init__(self,ms,d,lanes):
        self.ms,self.d=ms,d
        self.rows=np.concatenate([r for _,r in lanes]); self.lane=np.repeat(np.arange(len(lanes)),[len(r) for _,r in lanes])
        self.n=np.array([len(r) for _,r in lanes]); self.subj=np.array([s for s,_ in lanes]); self.L=len(lanes)
        self.s=d.s[:,self.rows]
        self.starts=np.concatenate([[0],np.cumsum(self.n)[:-1]])
    def sum(self,v): return np.add.reduceat(v,self.starts,axis=0)
    def at(self,th,c,x0=None,n=3):
        cc=c.copy(); cc[:6]+=th[self.lane].T
        return look(self.ms.girdle,self.s,cc,x0,n)
    def DJ(self,th):
        v,J=self.ms.pts(np.ascontiguousarray(th[:,:5].T)); v,J=np.asarray(v),np.asarray(J) # (P,L),(5,P,L)
        D=(v**2).mean(0); g=np.zeros((self.L,6)); H=np.zeros((self.L,6,6))
        g[:,:5]=2*np.einsum("kpl,pl->lk",J,v)/len(v); H[:,:5,:5]=2*np.einsum("kpl,jpl->lkj",J,J)/len(v)
        return D,g,H
    def adapt(self,c,th0,iters=30,tol=1e-4,x0=None):
        """min E for fixed channel offsets c (K,rows). th0 (L,6) offsets. returns th,E,look at th."""
        lam=np.full(self.L,1e-3); th=np.clip(th0,self.ms.lo,self.ms.hi)
        w=2*W_E/(6*self.n)
        def ev(th,x0,n):
            r=self.at(th,c,x0,n); D,gD,HD=self.DJ(th)
            J=self.sum((r[1]**2).sum(1))
            E=D+W_E/(6*self.n)*J+1e2*self.sum(np.minimum(r[5],1.0)**2*(r[5]>0.05))
            return r,E,gD,HD
        r,E,gD,HD=ev(th,x0,8)
        for it in range(iters):
            T=r[3][:,:,:6]
            g=gD+w[:,None]*self.sum(np.einsum("nkj,nk->nj",T,r[1]))
            H=HD+w[:,None,None]*self.sum(np.einsum("nkj,nki->nji",T,T))
            Hd=H+lam[:,None,None]*np.einsum("lk,kj->lkj",np.einsum("lkk->lk",H)+1e-6,np.eye(6))
            dth=box_step(Hd,g,self.ms.lo,self.ms.hi,th)
            if np.abs(dth).max()<tol: break
            r2,E2,gD2,HD2=ev(th+dth,r[0].T,3)
            ok=E2<=E+1e-9
            lam=np.where(ok,lam*0.1,np.maximum(lam*30,1e-3))
            okr=ok[self.lane]
            th=np.where(ok[:,None],th+dth,th); gain=np.where(ok,E-E2,0); E=np.where(ok,E2,E); gD=np.where(ok[:,None],gD2,gD); HD=np.where(ok[:,None,None],HD2,HD)
            r=[np.where(okr.reshape(-1,*[1]*(a.ndim-1)),b,a) for a,b in zip(r,r2)]
            if (gain.max()<1e-5*max(1,E.max()) and ok.all()): break
        return th,E,r
    def adapt_starts(self,c,starts=STARTS):
        best=None
        for o in starts:
            th,E,r=self.adapt(c,np.tile(o,(self.L,1)))
            if best is None: best=[th,E]
            else:
                b=E<best[1]; best[0]=np.where(b[:,None],th,best[0]); best[1]=np.where(b,E,best[1])
        return best

def lomo_lanes(d):
    """all rows per subject, then each (subject, motion held out) -> lanes and held rows."""
    full=[(s,np.flatnonzero(d.subj==s)) for s in range(d.S)]
    folds=[];held=[]
    for s in range(d.S):
        for m in range(len(d.motions)):
            r=np.flatnonzero((d.subj==s)&(d.mot==m))
            if len(r): folds.append((s,np.flatnonzero((d.subj==s)&(d.mot!=m)))); held.append((s,m,r))
    return full,folds,held

def gap_of(ms,d,th,c,subj_rows,x0=None):
    """|x-s| (rows,6) at given rows with theta per row (rows,6), c (K,rows)."""
    cc=c.copy(); cc[:6]+=th.T
    x=look(ms.girdle,d.s[:,subj_rows],cc,None,12)
    return np.abs(x[0]-d.s[:,subj_rows].T), x[5]
