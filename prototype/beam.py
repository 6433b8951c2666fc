"""The recommended method, prototype: beam over sets of causes, exact fits under E, held-out (person, motion) score, weights by
Bayesian bootstrap over persons and motions, slots of names that replace one another."""
from diag import *
from fingerprint import fingerprint
NEFF=3.0        # a motion of a person tells one number of each constraint
PRIOR=np.log(2/30)  # two causes expected of thirty
DROP=("clavicle_axial:clav_posture","clavicle_axial:scap_posture")
class Beam(Diagnosis):
    def __init__(self,ms,d,**k):
        super().__init__(ms,d,lib=[c for c in library(d,ms) if c.name not in DROP],**k)
        kind="both" if (self.st.kind=="both").any() else "motion"
        self.use=self.st.kind==kind; self.e=np.cumsum([0]+[len(r) for r in self.st.rows]); self.nr=np.diff(self.e)
        # folds: mean of both kinds of the same (s,m)
        self.F=[(t[1],t[2]) for t,u in zip(self.st.test,self.use) if u]
        self.person=d.person[[f[0] for f in self.F]]
        self.seen={}
    def q(self,y):
        """mean |y|^2 of each (subject, motion), mean of motion-unseen and person-and-motion-unseen."""
        m=np.add.reduceat((y**2).sum(1),self.e[:-1])/self.nr
        ks=[k for k in ("motion","both") if (self.st.kind==k).any()]
        return np.mean([m[self.st.kind==k] for k in ks],axis=0)
    def logprior(self,H,a):
        ix=self.ix(H); return len(H)*PRIOR-0.5*(((a-self.mean[ix])/self.scale[ix])**2).sum()
    def value(self,q,H,a,w=None):
        w=np.ones(len(q)) if w is None else w
        return -0.5*NEFF*w.sum()*np.log((w*q).sum()/w.sum())+self.logprior(H,a)
    def add(self,H,th,a):
        key=tuple(sorted(H))
        if key in self.seen: return self.seen[key]
        e=self.exact(H,th,a)
        ok=self.ok(H,e[2]); q=self.q(e[5]); v=self.value(q,H,e[2]) if ok else -1e9
        self.seen[key]=(v,e,q); return self.seen[key]
    def expand(self,node,top):
        """linear value of node + each candidate."""
        v,e,q=node; H,th,a,fm,cv=e[:5]; out=[]
        for c in self.lib:
            if c.name in H: continue
            H2=H+[c.name]
            if tuple(sorted(H2)) in self.seen: continue
            ix=self.ix(H2); an=np.concatenate([a,np.zeros(len(c.scale))])
            da,dth=cv.solve(ix,self.scale[ix],an,self.mean[ix]); cv.score(ix,da,dth)
            if c.name=="skin_artefact" and (an+da[0])[-1]<0.2: continue
            out.append((self.value(self.q(cv.last_y),H2,an+da[0]),H2,th,np.concatenate([a,self.mean[self.span[c.name]]])))
        out.sort(key=lambda o:-o[0]); return out[:top]
    def search(self,widths=((1,10,10),(4,4,10),(3,4,8),(2,4,5),(1,3,3)),strata=("skin_artefact",)):
        """beam in two strata, sets with and without the cause that others hide (skin_artefact), so that it is tried beside good sets."""
        t=time.time(); c0=time.process_time(); self.times=[]
        self.add([],self.th_none,np.zeros(0)); 
        for name in (None,)+strata:
            if name is None: level=[self.seen[()]]
            else: level=[self.add([name],self.th_none,self.mean[self.span[name]])]; 
            if level[0][0]<-1e8: level=[self.seen[()]] if name is None else level
            best=level[0][0]
            for n_from,each,n_exact in widths:
                todo={}
                for node in sorted(level,key=lambda n:-n[0])[:n_from]:
                    if name and name in node[1][0] and node[0]<-1e8: pass
                    for o in self.expand(node,each):
                        if name is None and strata[0] in o[1]: continue
                        k=tuple(sorted(o[1]))
                        if k not in todo or todo[k][0]<o[0]: todo[k]=o
                level=[self.add(*o[1:]) for o in sorted(todo.values(),key=lambda o:-o[0])[:n_exact if name is None else max(2,n_exact//2)]]
                if not level: break
                b_=max(l[0] for l in level); self.times.append(time.time()-t)
                if b_<best-3 and name is None: break
                best=max(b_,best)
        self.seconds=time.time()-t; self.cpu=time.process_time()-c0; return self
    def weigh(self,draws=300,seed=7):
        keys=[k for k,v in self.seen.items() if v[0]>-1e8]; Q=np.array([self.seen[k][2] for k in keys]); lp=np.array([self.logprior(self.seen[k][1][0],self.seen[k][1][2]) for k in keys])
        rng=np.random.default_rng(seed); P=self.person.max()+1; W=np.zeros(len(keys)); n=Q.shape[1]
        for b in range(draws):
            w=rng.dirichlet(np.ones(n))*n
            if P>1: w=w*rng.dirichlet(np.ones(P))[self.person]*P; w*=n/w.sum()
            el=-0.5*NEFF*n*np.log((Q*w).sum(1)/n)+lp; p=np.exp(el-el.max()); W+=p/p.sum()
        self.keys,self.W=keys,W/draws; 
        inc={}
        for k,w in zip(keys,self.W):
            for h in k: inc[h]=inc.get(h,0)+w
        self.inc=dict(sorted(inc.items(),key=lambda t:-t[1])); return self
    def similar(self,cv,h,k):
        """mean squared canonical correlation of the columns of h and k with theta of every shoulder projected out, at the fit cv."""
        Z=cv.Z; d=self.d; out=[]
        def proj(ix):
            A=Z[:,:,6+ix].copy()
            for s in range(d.S):
                r=d.subj==s; X=Z[r][:,:,:6].reshape(-1,6); B=A[r].reshape(-1,len(ix)); A[r]=(B-X@np.linalg.lstsq(X,B,rcond=None)[0]).reshape(A[r].shape)
            return np.linalg.qr(A.reshape(-1,len(ix)))[0]
        a,b=proj(self.span[h]),proj(self.span[k]); s=np.linalg.svd(a.T@b,compute_uv=False); return float((s**2).sum()/min(a.shape[1],b.shape[1]))
    def slots(self,level=0.95):
        """causes: the most probable set; of each of its causes the names that replace it."""
        i=int(np.argmax(self.W)); top=self.keys[i]; self.top=top; out=[]
        cv=self.seen[top][1][4]; names=list(self.inc)
        mass={h:{h:0.0} for h in top}
        for k,w in zip(self.keys,self.W):
            rest=[h for h in k if h not in top]; free=[h for h in top if h not in k]
            for h in k:
                if h in top: mass[h][h]+=w
            while rest and free:
                s=[(self.similar(cv,f,r),f,r) for f in free for r in rest]; _,f,r=max(s); mass[f][r]=mass[f].get(r,0)+w; rest.remove(r); free.remove(f)
        for h in top:
            m=sorted(mass[h].items(),key=lambda t:-t[1]); tot=sum(x for _,x in m); c=0; names=[]
            for n,x in m:
                names.append((n,x/tot)); c+=x
                if c>=level*tot: break
            out.append((h,tot,names))
        self.slots_=out; return out
    def report(self,verbose=True):
        self.weigh(); s=self.slots(); e=self.seen[self.top][1]; e0=self.seen[()][1]
        self.fp=fingerprint(self.d)
        if verbose:
            print("  %d sets, %.1f s (cpu %.1f); top %s  none %s -> %s"%(len(self.seen),self.seconds,self.cpu,self.top,summary(e0[3],self.st.kind),summary(e[3],self.st.kind)))
            for k in np.argsort(-self.W)[:5]: print("     %.2f %s %.2f a %s"%(self.W[k],self.keys[k],self.loss(self.seen[self.keys[k]][1][3]),np.round(self.seen[self.keys[k]][1][2],1)))
            for h,p,names in s: print("     cause p=%.2f: %s"%(p,", ".join("%s %.2f"%x for x in names)))
            print("     inclusion",{k:round(float(v),2) for k,v in list(self.inc.items())[:9]}, "skin %.3f axial %.3f"%(self.inc.get("skin_artefact",0),self.inc.get("clavicle_axial_estimate",0)),"fingerprint %.2f"%max(b[0] for b in self.fp),flush=True)
        return self
def gates(B):
    """for each cause of the top set: relative gain and t of having it, over (person, motion) folds and over motions."""
    e=B.seen[B.top][1]; out={}
    for h in B.top:
        Hd=[x for x in e[0] if x!=h]; keep=np.isin(B.ix(e[0]),B.ix(Hd)); n=B.add(Hd,e[1],e[2][keep]); out[h]=B.gain(n[1][3],e[3])
    return out
if __name__=="__main__":
    import pickle
    log=sys.argv[3] if len(sys.argv)>3 else "beam"
    for sub in sys.argv[2].split(","):
        for n in sys.argv[1].split(","):
            sub=sub.strip("-"); d=known(sub); ms=get_set(n); t=time.time(); B=Beam(ms,d); t0=time.time()-t
            print("==",n,sub or "base","set-up %.1f"%t0); B.search().report(); g=gates(B)
            print("     gates",{h:["%.2f t%.1f"%x for x in v] for h,v in g.items()},flush=True)
            f="cache/%s_%s_%s.pkl"%(log,n,sub or "base"); pickle.dump(dict(inc=B.inc,top=B.top,slots=B.slots_,gates=g,a={k:v[1][2] for k,v in B.seen.items()},H={k:v[1][0] for k,v in B.seen.items()},fm={k:v[1][3] for k,v in B.seen.items()},q={k:v[2] for k,v in B.seen.items()},kind=B.st.kind,fp=B.fp,cpu=B.cpu,W=dict(zip(B.keys,B.W))),open(f,"wb"))
