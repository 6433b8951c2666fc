from search import *
class LinCV:
    """Cross-validation by linear algebra at one full-data fit (th (S,6), a0 of cands cur)."""
    def __init__(self,st,th,cur_cols,a0,lib_cols,lam=1.0):
        """lib_cols (k,K,N): all columns that may be asked for (the current ones among them)."""
        self.st=st; d=st.d; ms=st.ms; S=d.S; self.S=S; M=len(d.motions); self.M=M
        N=len(d.subj); c=np.einsum("k,kcn->cn",a0,cur_cols) if len(a0) else np.zeros((K,N)); c=c.copy(); c[:6]+=th[d.subj].T
        x,y,W,T,B,gape=look(ms.girdle,d.s,c,None,12)
        self.y,self.B,self.th=y,B,th
        nz=[np.flatnonzero(np.abs(cc).max(1)>0) for cc in lib_cols]
        A=np.stack([np.einsum("nic,cn->ni",T[:,:,i],cc[i]) for i,cc in zip(nz,lib_cols)],2)
        self.Z=np.concatenate([T[:,:,:6],A,y[:,:,None]],2)   # N,3,6+k+1
        q=self.Z.shape[2]
        self.Nb=np.zeros((S,M,q,q)); self.cnt=np.zeros((S,M),int)
        for s in range(S):
            for m in range(M):
                r=np.flatnonzero((d.subj==s)&(d.mot==m)); self.cnt[s,m]=len(r)
                z=self.Z[r].reshape(-1,q); self.Nb[s,m]=z.T@z
        P=Problem(ms,d,[(s,np.flatnonzero(d.subj==s)) for s in range(S)]); D,gD,HD=P.DJ(th)
        G=st.G; L=len(G.P.subj); self.lane_s=G.P.subj
        # held motion of lane
        self.train=np.ones((L,M),bool)
        for l in range(L):
            r=G.P.rows[G.P.lane==l]; self.train[l]=np.isin(np.arange(M),d.mot[r])
        self.n=(self.cnt[self.lane_s]*self.train).sum(1)
        NL=np.einsum("lm,lmij->lij",self.train*1.0,self.Nb[self.lane_s])*(2*W_E/(6*self.n))[:,None,None]
        NL[:,:6,:6]+=HD[self.lane_s]; NL[:,:6,-1]+=gD[self.lane_s]; NL[:,-1,:6]+=gD[self.lane_s]
        self.NL=NL; self.g=G.g; self.G=G.G; self.v=G.v; self.lam=lam
        self.rows=np.concatenate(st.rows); self.lane_r=np.concatenate([np.full(len(r),t[3]) for t,r in zip(st.test,st.rows)]); self.grp_r=np.concatenate([np.full(len(r),t[4]) for t,r in zip(st.test,st.rows)])
        self.fold_start=np.cumsum([0]+[len(r) for r in st.rows])[:-1]; self.fold_n=np.array([len(r) for r in st.rows])
    def solve(self,ix,scale,a_now,mean,lanes=None):
        """columns ix of lib; a_now current values. returns da (G,k), dth (L,6)."""
        k=len(ix); jj=6+np.asarray(ix,int); H=self.NL; th=self.th[self.lane_s]; lo,hi=self.st.ms.lo,self.st.ms.hi
        Htt=H[:,:6,:6]; Hta=H[:,:6][:,:,jj]; Haa=H[:,jj][:,:,jj]; gt=H[:,:6,-1]; ga0=H[:,jj,-1]
        L=len(th); fixed=np.zeros((L,6),bool); fixd=np.zeros((L,6)); eye=np.eye(6)
        for rep in range(6):
            Hm=np.where(fixed[:,:,None]|fixed[:,None,:],0,Htt)+fixed[:,:,None]*eye
            f=np.where(fixed,fixd,0)
            rhs0=np.where(fixed,fixd,-(gt+np.einsum("lkj,lj->lk",Htt,f)))
            S_=np.linalg.solve(Hm,np.concatenate([rhs0[...,None],np.where(fixed[:,:,None],0,Hta)],2))
            if k:
                ga=self.v[:,None]*(ga0+np.einsum("lkj,lk->lj",Hta,S_[:,:,0])); Ha=self.v[:,None,None]*(Haa-np.einsum("lkj,lki->lji",Hta,S_[:,:,1:]))
                GA=np.zeros((self.G,k)); np.add.at(GA,self.g,ga); HA=np.zeros((self.G,k,k)); np.add.at(HA,self.g,Ha)
                GA+=2*self.lam*(a_now-mean)/scale**2; HA+=np.diag(2*self.lam/scale**2)
                da=-np.linalg.solve(HA,GA[...,None])[...,0]
                dth=S_[:,:,0]-np.einsum("lkj,lj->lk",S_[:,:,1:],da[self.g])
            else: da=np.zeros((self.G,0)); dth=S_[:,:,0]
            bad=((th+dth<lo-1e-9)|(th+dth>hi+1e-9))&~fixed
            if not bad.any(): break
            fixd=np.where(bad,np.where(th+dth<lo,lo-th,hi-th),fixd); fixed|=bad
        return da,np.clip(th+dth,lo,hi)-th
    def score(self,ix,da,dth):
        r=self.rows; Z=self.Z[r]; yy=self.y[r]+np.einsum("nij,nj->ni",Z[:,:,:6],dth[self.lane_r])
        if len(ix): yy=yy+np.einsum("nij,nj->ni",Z[:,:,6+np.asarray(ix,int)],da[self.grp_r])
        gap=np.abs(np.einsum("nij,ni->nj",self.B[r],yy)); self.last_y=yy
        return np.add.reduceat(gap,self.fold_start,axis=0)/self.fold_n[:,None]
