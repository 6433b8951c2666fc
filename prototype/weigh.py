"""Pseudo-BMA+ (Bayesian bootstrap over persons x motions) of stored hypotheses with GP log scores."""
import pickle, sys, numpy as np
from diag import *
from gp import *
def weigh(res,st,d,kind="both",prior_in=2/30,draws=400,seed=1,verbose=True,by=None,plaus=1.0,mode='fold',neff=None):
    """res: {names: (a, fm, y)}"""
    names=list(res); sc=Scorer(st); use=st.kind==kind
    L=np.array([D_loss(res[k][1],st.kind) for k in names])
    order=np.argsort(L)[:400]; names=[names[i] for i in order]
    # hyperparameters of the GP: ML at the best hypothesis, shape shared; s2 free for each hypothesis
    ll,g,s2,_=sc.fit(np.asarray(res[names[0]][2],float),use)
    if verbose: print("GP of the best: ell %.2f noise share %.2f s %.2f deg; effective numbers a fold %.1f of %.1f"%(g[0],g[1],np.sqrt(s2),sc.neff(g)[use].mean(),3*sc.n[use].mean()))
    Q=np.array([sc.quad(np.asarray(res[k][2],float),g)[use] for k in names])   # H x folds
    n=3*sc.n[use]
    if mode=='fold':
        ne=neff or sc.neff(g)[use].mean(); Q=np.array([np.add.reduceat((np.asarray(res[k][2],float)**2).sum(1),[b[0].start for b in sc.bl])[use]/sc.n[use] for k in names])/3*ne; n=np.full(use.sum(),ne)
    rng=np.random.default_rng(seed)
    test=[t for t,u in zip(st.test,use) if u]; person=d.person[[t[1] for t in test]]
    P=person.max()+1
    lp=np.array([len(k)*np.log(prior_in)-0.5*plaus*(((res[k][0]-np.concatenate([getattr(by[h],'mean',np.zeros(len(by[h].scale))) for h in k] or [np.zeros(0)]))/np.concatenate([by[h].scale for h in k] or [np.ones(0)]))**2).sum() for k in names])
    W=np.zeros(len(names))
    for b in range(draws):
        w=rng.dirichlet(np.ones(P))[person]*P*rng.dirichlet(np.ones(len(n)))*len(n) if P>1 else rng.dirichlet(np.ones(len(n)))*len(n)
        # temper to effective count: GP likelihood, s2 profiled
        S=(Q*w).sum(1); N=(n*w).sum(); el=-0.5*N*np.log(S/N)+lp
        el-=el.max(); p=np.exp(el); W+=p/p.sum()
    W/=draws
    return names,W,L[order],g
def D_loss(fm,kind): return np.mean([fm[kind==k].mean() for k in ("motion","both")])
def inclusion(names,W):
    inc={}
    for k,w in zip(names,W):
        for h in k: inc[h]=inc.get(h,0)+w
    return dict(sorted(inc.items(),key=lambda t:-t[1]))
if __name__=="__main__":
    n,sub=sys.argv[1:3]; sub=sub.strip("-"); d=known(sub); ms=get_set(n); D=Diagnosis(ms,d)
    res,kind=pickle.load(open(f"cache/pairs_{n}_{sub or 'base'}.pkl","rb"))
    for kd,md,ne in (("both","fold",None),("both","fold",3.0),("motion","fold",None)):
        names,W,L,g=weigh(res,D.st,d,kd,by=D.by,mode=md,neff=ne)
        o=np.argsort(-W)[:10]; print(kd); 
        for i in o: print("  %.3f loss %.3f %s %s"%(W[i],L[i],names[i],np.round(res[names[i]][0],1)))
        print("  inclusion",[(k,round(v,2)) for k,v in list(inclusion(names,W).items())[:10]])
