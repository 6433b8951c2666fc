"""Names from the inclusion probabilities: median probability model, then the predictive gate, backwards."""
from beam import *
import pickle
FP_DEG=0.1
def named(D,inc,fp,p_min=0.5,min_gain=0.05,t_min=2.0,verbose=False):
    H=[h for h,p in inc.items() if p>=p_min]
    def fit(H,e=None):
        # from the nearest seen fit
        th,a=(D.th_none,D.mean[D.ix(H)]) if e is None else (e[1],np.concatenate([e[2][[list(D.ix(e[0])).index(i) for i in D.span[h]]] if h in e[0] else D.mean[D.span[h]] for h in H]+[np.zeros(0)]))
        return D.exact(H,th,a,25)
    cur=fit(H)
    # refit by steps too, the better value
    e=D.exact([],D.th_none,np.zeros(0))
    for i in range(len(H)): e=fit(H[:i+1],e)
    cur=e
    def paired(f0,f1):
        ks=[k for k in D.kinds if (D.st.kind==k).any()]; d_=np.mean([(f0-f1)[D.st.kind==k].mean(1) for k in ks],axis=0); b=np.mean([f0[D.st.kind==k].mean() for k in ks])
        return d_.mean()/b, d_.mean()/(d_.std(ddof=1)/np.sqrt(len(d_))), min((f0-f1)[D.st.kind==k].mean() for k in ks)
    while cur[0]:
        g={}
        for h in cur[0]:
            r=fit([x for x in cur[0] if x!=h],cur); g[h]=(paired(r[3],cur[3]),r)
        w=min(g,key=lambda h:g[h][0][1] if g[h][0][0]>=min_gain else g[h][0][0]-9)
        (gn,t,worst),r=g[w]
        if gn>=min_gain and t>=t_min and worst>0: break
        cur=r
    out={h:g[h][0] for h in cur[0]} if cur[0] else {}
    names=list(cur[0])+(["clavicle_axial_estimate*"] if max(b[0] for b in fp)<FP_DEG and "clavicle_axial_estimate" not in cur[0] else [])
    return names,cur,out
if __name__=="__main__":
    run=sys.argv[1]
    for n in sys.argv[2].split(","):
        for sub in sys.argv[3].split(","):
            sub=sub.strip("-"); f="cache/%s_%s_%s.pkl"%(run,n,sub or "base")
            if not os.path.exists(f): continue
            P=pickle.load(open(f,"rb")); d=known(sub); D=Beam(get_set(n),d); 
            names,cur,g=named(D,P["inc"],P["fp"]); print("%-20s %-5s %s | %s | gates %s"%(n,sub or "base",names,summary(cur[3],D.st.kind),{h[:12]:"%.2f t%.1f"%v[:2] for h,v in g.items()}),"a",np.round(cur[2],1).tolist(),flush=True)
