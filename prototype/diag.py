from lin import *
from truths import *
import functools
@functools.lru_cache(None)
def get_set(n): return Set(n)
class Diagnosis:
    def __init__(self,ms,d,lib=None,th_none=None,min_gain=0.05,t_min=2.0,verbose=False,kinds=("motion","both")):
        self.ms,self.d=ms,d; self.lib=lib or library(d,ms); self.v=verbose; self.min_gain,self.t_min=min_gain,t_min
        self.t0=time.time(); S=d.S
        one=Groups(ms,d,standard_groups(d)[:1]); self.full=one
        if th_none is None: th_none,_=one.P.adapt_starts(np.zeros((K,len(one.P.rows))))
        self.th_none=th_none
        st=Study.__new__(Study); st.ms,st.d=ms,d
        M=len(d.motions); groups=standard_groups(d); w=[np.ones(S)]*(M+1); st.test=[]
        has=lambda s,m: ((d.subj==s)&(d.mot==m)).any()
        for m in range(M):
            for s in range(S):
                if has(s,m): st.test.append(("motion",s,m,(m+1)*S+s,m+1))
        g=M+1
        for p in range(d.person.max()+1):
            if not (d.person!=p).any(): continue
            for m in range(M):
                groups.append(groups[m+1]); w.append(np.where(d.person==p,1e-5,1.0))
                for s in np.flatnonzero(d.person==p):
                    if has(s,m): st.test.append(("both",s,m,g*S+s,g))
                g+=1
        st.G=Groups(ms,d,groups,w); st.rows=[np.flatnonzero((d.subj==s)&(d.mot==m)) for _,s,m,_,_ in st.test]; st.kind=np.array([t[0] for t in st.test])
        self.st=st; self.kinds=kinds
        k=np.cumsum([0]+[len(c.scale) for c in self.lib]); self.span={c.name:np.arange(k[i],k[i+1]) for i,c in enumerate(self.lib)}
        self.by={c.name:c for c in self.lib}; self.cols=np.concatenate([c.cols for c in self.lib]); self.scale=np.concatenate([c.scale for c in self.lib])
        self.mean=np.concatenate([getattr(c,'mean',np.zeros(len(c.scale))) for c in self.lib])
        self.cache={}
    def ix(self,H): return np.concatenate([np.zeros(0,int)]+[self.span[h] for h in H]).astype(int)
    def exact(self,H,th,a,iters=15):
        """full-data joint fit and CV scores around it."""
        key=tuple(sorted(H)); 
        if key in self.cache: return self.cache[key]
        ix=self.ix(H)
        if len(ix): th,a,E,F,r,it=self.full.joint(self.cols[ix],self.scale[ix],th,a[None],1.0,iters,self.mean[ix]); a=a[0]
        cv=LinCV(self.st,th,self.cols[ix],a,self.cols)
        da,dth=cv.solve(ix,self.scale[ix],a,self.mean[ix]); fm=cv.score(ix,da,dth)
        self.cache[key]=(list(H),th,a,fm,cv,cv.last_y.copy()); return self.cache[key]
    def loss(self,fm): return np.mean([fm[self.st.kind==k].mean() for k in self.kinds if (self.st.kind==k).any()])
    def ok(self,H,a):
        if "skin_artefact" in H:
            i=list(self.ix(H)).index(self.span["skin_artefact"][0])
            return a[i]>0.3
        return True
    def gain(self,fm0,fm1):
        """relative gain and its t over folds, of each kind."""
        out=[]
        for k in self.kinds:
            q=self.st.kind==k
            if not q.any(): continue
            df=(fm1-fm0)[q].mean(1); out.append((-df.mean()/fm0[q].mean(),-df.mean()/(df.std(ddof=1)/np.sqrt(len(df)))))
        return out
    def screen(self,cur,top=8,skip=()):
        H,th,a,fm,cv=cur[:5]; res=[]
        for c in self.lib:
            if c.name in H or c.name in skip: continue
            H2=H+[c.name]; ix=self.ix(H2); an=np.concatenate([a,self.mean[self.span[c.name]]*0])
            da,dth=cv.solve(ix,self.scale[ix],an,self.mean[ix]); f2=cv.score(ix,da,dth)
            res.append((self.loss(f2),c.name,th+dth[:self.d.S],an+da[0]))
        res.sort(key=lambda r:r[0]); return res[:top]
    def step(self,cur,top=8):
        best=[]
        for l,name,th,a in self.screen(cur,top):
            # start from the linear prediction, or from the current fit
            H2=cur[0]+[name]; e=self.exact(H2,cur[1],np.concatenate([cur[2],self.mean[self.span[name]]]))
            if self.ok(H2,e[2]): best.append((self.loss(e[3]),e,name,l))
        best.sort(key=lambda b:b[0]); return best
    def run(self,most=5,top=8):
        cur=self.exact([],self.th_none,np.zeros(0)); self.trace=[]
        for k in range(most):
            best=self.step(cur,top)
            if self.v:
                print("  at %s loss %.3f  %s"%(cur[0],self.loss(cur[3]),summary(cur[3],self.st.kind)))
                for l,e,n,ll in best[:5]: print("    + %-28s %.3f (lin %.3f) %s gain %s a %s"%(n,l,ll,summary(e[3],self.st.kind),["%.2f t%.1f"%g for g in self.gain(cur[3],e[3])],np.round(e[2][-len(self.span[n]):],1)),flush=True)
            self.trace.append((cur,best))
            if not best: break
            g=self.gain(cur[3],best[0][1][3])
            if min(x[0] for x in g)<0 or np.mean([x[0] for x in g])<self.min_gain or max(x[1] for x in g)<self.t_min: break
            cur=best[0][1]
            # backward
            while len(cur[0])>1:
                drops=[]
                for h in cur[0][:-1]:
                    Hd=[x for x in cur[0] if x!=h]; keepix=np.isin(self.ix(cur[0]),self.ix(Hd))
                    e=self.exact(Hd,cur[1],cur[2][keepix]); drops.append((self.loss(e[3]),e,h))
                drops.sort(key=lambda b:b[0]); g=self.gain(drops[0][1][3],cur[3])
                if np.mean([x[0] for x in g])<self.min_gain*0.6:
                    if self.v: print("    - drop",drops[0][2],g)
                    cur=drops[0][1]
                else: break
        self.cur=cur; return cur
if __name__=="__main__":
    names=sys.argv[1].split(","); subs=sys.argv[2].split(",")
    for n in names:
        for sub in subs:
            sub=sub.strip("-"); d=known(sub); ms=get_set(n); t=time.time(); D=Diagnosis(ms,d,verbose=True); cur=D.run()
            print("==",n,sub or "base",cur[0],"%.3f"%D.loss(cur[3]),summary(cur[3],D.st.kind),"%.1fs"%(time.time()-t),flush=True)
