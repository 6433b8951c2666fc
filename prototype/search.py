from joint import *
class Study:
    """All folds of a data set with a parameter set: group 0 all, 1..M motion held out, then (person, motion) both held out."""
    def __init__(self,ms,d,tag=None,strict=True):
        self.ms,self.d=ms,d; S=d.S; M=len(d.motions)
        groups=standard_groups(d); w=[np.ones(S)]*(M+1); self.test=[]
        has=lambda s,m: ((d.subj==s)&(d.mot==m)).any()
        for m in range(M):
            for s in range(S):
                if has(s,m): self.test.append(("motion",s,m,(m+1)*S+s,m+1))
        if strict:
            g=M+1
            for p in range(d.person.max()+1):
                if not (d.person!=p).any(): continue
                for m in range(M):
                    groups.append(groups[m+1]); w.append(np.where(d.person==p,1e-5,1.0))
                    for s in np.flatnonzero(d.person==p):
                        if has(s,m): self.test.append(("both",s,m,g*S+s,g))
                    g+=1
        self.G=Groups(ms,d,groups,w)
        base=Groups(ms,d,standard_groups(d))
        f=f"cache/none_{ms.name}_{tag}.npz" if tag else None
        if f and os.path.exists(f): th=np.load(f)["th"]
        else:
            th,_=base.P.adapt_starts(np.zeros((K,len(base.P.rows))))
            if f: np.savez(f,th=th)
        self.th0=np.concatenate([th]+([th.reshape(M+1,S,6)[1:].reshape(-1,6)]*(d.person.max()+1) if strict and (d.person.max()>0) else []))
        self.rows=[np.flatnonzero((d.subj==s)&(d.mot==m)) for _,s,m,_,_ in self.test]
        self.kind=np.array([t[0] for t in self.test])
    def score(self,cols,th,a):
        idx=np.concatenate(self.rows); thr=np.concatenate([np.tile(th[t[3]],(len(r),1)) for t,r in zip(self.test,self.rows)])
        ar=np.concatenate([np.tile(a[t[4]],(len(r),1)) for t,r in zip(self.test,self.rows)])
        c=np.einsum("nk,kcn->cn",ar,cols[:,:,idx]) if cols.shape[0] else np.zeros((K,len(idx)))
        g,gape=gap_of(self.ms,self.d,thr,c,idx)
        e=np.cumsum([0]+[len(r) for r in self.rows])
        return np.array([g[a_:b_].mean(0) for a_,b_ in zip(e[:-1],e[1:])])  # folds x 6
    def fit(self,cands,th0=None,a0=None,lam=1.0,iters=12):
        cols=np.concatenate([c.cols for c in cands]) if cands else np.zeros((0,K,len(self.d.subj)))
        if not cands: 
            return self.th0,np.zeros((self.G.G,0)),self.score(cols,self.th0,np.zeros((self.G.G,0))),np.nan
        scale=np.concatenate([c.scale for c in cands]); mean=np.concatenate([getattr(c,'mean',np.zeros(len(c.scale))) for c in cands])
        a=np.zeros((self.G.G,len(scale)))+mean if a0 is None else a0
        th,a,E,F,r,it=self.G.joint(cols,scale,self.th0 if th0 is None else th0,a,lam,iters,mean)
        return th,a,self.score(cols,th,a),F[0]
def summary(fm,kind):
    return " ".join("%s %.2f (%.2f,%.2f)"%(k,fm[kind==k].mean(),fm[kind==k][:,3:].mean(),fm[kind==k][:,:3].mean()) for k in dict.fromkeys(kind))
def forward(st,lib,steps=4,crit="both",top=6,allowed=None):
    cur=[];th,a,fm,F=st.fit([]); print("none",summary(fm,st.kind))
    for k in range(steps):
        best=[]
        for c in lib:
            if c.name in [x.name for x in cur]: continue
            kk=len(c.scale)
            a0=np.concatenate([a,np.zeros((st.G.G,kk))+getattr(c,'mean',0)],1)
            th2,a2,fm2,F2=st.fit(cur+[c],th,a0)
            best.append((fm2[st.kind==crit].mean(),c,th2,a2,fm2,F2))
        best.sort(key=lambda b:b[0])
        for b in best[:top]:
            d1=(b[4]-fm).mean(1); 
            print("   + %-28s %s  d %s F %.0f a %s"%(b[1].name,summary(b[4],st.kind)," ".join("%.2f+-%.2f"%(d1[st.kind==q].mean(),d1[st.kind==q].std()/np.sqrt((st.kind==q).sum())) for q in ("motion","both")),b[5],np.round(b[3][0],1)),flush=True)
        cur=cur+[best[0][1]]; _,_,th,a,fm,F=best[0]
        print("->",[c.name for c in cur],summary(fm,st.kind),flush=True)
