"""single persons left out: names on base and c with the two persons that remain (dissection), and cC (own-way, clipped)."""
from name import *
def go(n,d,lab):
    D=Beam(get_set(n),d); D.search().report(verbose=False); names,cur,g=named(D,D.inc,D.fp)
    print("%-20s %-22s %s | %s | skin %.3f axial %.3f fp %.2f cpu %.0f top inc %s"%(n,lab,names,summary(cur[3],D.st.kind),D.inc.get("skin_artefact",0),D.inc.get("clavicle_axial_estimate",0),max(b[0] for b in D.fp),D.cpu,{k:round(float(v),2) for k,v in list(D.inc.items())[:4]}),flush=True)
for n,sub,out in (("breteler_dissection","cC",None),("breteler_dissection","",2),("breteler_dissection","c",2),("breteler_dissection","",0),("breteler_dissection","c",0),("breteler_dissection","",1),("breteler_dissection","c",1),("breteler_mri","",1)):
    d=known(sub); 
    if out is not None: d=keep(d,[s for s in range(d.S) if d.person[s]!=out])
    go(n,d,(sub or "base")+("" if out is None else " without cadaver%d"%(out+1)))
