from diag import *
import itertools, pickle
for n in sys.argv[1].split(","):
    for sub in sys.argv[2].split(","):
        sub=sub.strip("-"); f=f"cache/pairs_{n}_{sub or 'base'}.pkl"
        if os.path.exists(f): continue
        d=known(sub); ms=get_set(n); D=Diagnosis(ms,d); t=time.time(); res={}
        e0=D.exact([],D.th_none,np.zeros(0)); res[()]=(e0[2],e0[3],e0[5])
        ones={c.name:D.exact([c.name],D.th_none,D.mean[D.span[c.name]]) for c in D.lib}
        for k,v in ones.items(): res[(k,)]=(v[2],v[3],v[5])
        D.cache={k:v for k,v in D.cache.items() if len(k)<2}
        for x,y in itertools.combinations([c.name for c in D.lib],2):
            # from the better single
            b,o=(x,y) if D.loss(ones[x][3])<=D.loss(ones[y][3]) else (y,x)
            cv=ones[b][4]; ix=D.ix([b,o]); an=np.concatenate([ones[b][2],0*D.mean[D.span[o]]])
            e=D.exact([b,o],ones[b][1],np.concatenate([ones[b][2],D.mean[D.span[o]]]),iters=10)
            res[(b,o)]=(e[2],e[3],e[5]); D.cache.pop(tuple(sorted((b,o))),None)
        pickle.dump((res,D.st.kind),open(f,"wb"))
        L=sorted(res.items(),key=lambda r:D.loss(r[1][1]))
        print(n,sub or "base","%.0fs"%(time.time()-t))
        for k,(a,fm,_) in L[:14]: print("   %.3f %s %s"%(D.loss(fm),summary(fm,D.st.kind),k),flush=True)
