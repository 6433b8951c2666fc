"""Prototype engine: channels, nearest postures, adaptation under E or under Gaussian priors, folds."""
import os, sys, glob, time
os.environ.setdefault("OMP_NUM_THREADS", "1"); os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("XLA_FLAGS", "--xla_cpu_multi_thread_eigen=false intra_op_parallelism_threads=1")
sys.path.insert(0, ".")
import jax, jax.numpy as jnp, numpy as np
jax.config.update("jax_enable_x64", True)
jax.config.update("jax_compilation_cache_dir", "cache/jax")
jax.config.update("jax_persistent_cache_min_compile_time_secs", 0.5)
from dataclasses import dataclass, replace
from functools import partial
from models import load_model
from models.girdle import Girdle, chain_residuals_mm, bone_rotations
from models.ellipsoid import signed_distance_mm
from models.effects.thorax_shape import _offset_mm
from models.girdle import chain_landmarks
from motions import read_motions
from motions.rhythm import REST_DEG
from motions.rotations import compose, rotate, rotation_from_cardan, rotation_from_vector
DEG = 180/np.pi
CH = ["M_y","M_z","A_x","A_y","A_z","L","M_x","sc_x","sc_y","sc_z","ac_x","ac_y","ac_z","cc_x","cc_y","cc_z",
      "ts_x","ts_y","ts_z","ai_x","ai_y","ai_z","cs_x","cs_y","cs_z","d_ts","d_ai",
      "rc_x","rc_y","rc_z","rs_x","rs_y","rs_z","rt_x","rt_y","rt_z","tilt_x","tilt_y","tilt_z","shape","shape2"]
PC = ["d_ts","d_ai","L","ac_x","ac_y","ac_z","sc_x","sc_y","sc_z","rc_x","rt_x","rt_y","rt_z"]   # channels that may follow the posture
PA = ["cy","cz","cx","sy","sz","sx"]
K0 = len(CH)
CH = CH + [f"{a}@{b}" for a in PC for b in PA]
IX = {n:i for i,n in enumerate(CH)}
K = len(CH)
ROT0 = IX["rc_x"]

def _residual(gird, x, c):
    """A1-A3 at angles x (6,N) deg with channels c (K,N): theta absolute?? no: all channels are offsets."""
    g = gird
    R_c, R_s = bone_rotations(x/DEG)
    M = g.centre_mm[:,None] + jnp.stack([c[6],c[0],c[1]]); A = g.semi_axes_mm[:,None]+c[2:5]
    sc = g.sc_mm[:,None]+c[7:10]; ac = g.ac_mm[:,None]+c[10:13]; cc=g.clavicle_conoid_mm[:,None]+c[13:16]
    ts = g.ts_mm[:,None]+c[16:19]; ai=g.ai_mm[:,None]+c[19:22]; cs=g.scapula_conoid_mm[:,None]+c[22:25]
    R_c = compose(R_c, rotation_from_vector(c[27:30]/DEG)); R_s = compose(R_s, rotation_from_vector(c[30:33]/DEG))
    from motions.rotations import cardan_from_rotation
    q = (jnp.concatenate([cardan_from_rotation(R_c),cardan_from_rotation(R_s)])*DEG - REST_DEG[:,None])/30.0
    post = jnp.einsum("jkn,kn->jn", c[K0:].reshape(len(PC),6,-1), q)
    d_ts,d_ai,dL = post[0],post[1],post[2]; ac=ac+post[3:6]; sc=sc+post[6:9]
    R_c = compose(R_c, rotation_from_cardan(jnp.stack([0*post[9],0*post[9],post[9]/DEG])))
    Rt = jnp.swapaxes(rotation_from_vector((c[33:36]+post[10:13])/DEG),0,1)
    R_c, R_s = compose(Rt,R_c), compose(Rt,R_s)
    Re = jnp.swapaxes(rotation_from_vector(c[36:39]/DEG),0,1)
    sc = M + rotate(Re, sc-M); R_c, R_s = compose(Re,R_c), compose(Re,R_s)
    gg = Girdle(M,A,sc,ac,cc,ts,ai,cs, g.ts_distance_mm+c[25]+d_ts, g.ai_distance_mm+c[26]+d_ai, g.conoid_length_mm+c[5]+dL)
    at = chain_landmarks(gg,R_c,R_s)
    e1, e2 = c[39]+c[40], c[39]-c[40]
    gg = replace(gg, ts_distance_mm=gg.ts_distance_mm+_offset_mm(at.TS,gg,e1,e2), ai_distance_mm=gg.ai_distance_mm+_offset_mm(at.AI,gg,e1,e2))
    return chain_residuals_mm(gg,R_c,R_s)

def _inv_chol3(V):
    """inverse of lower Cholesky of (3,3,N)."""
    a=jnp.sqrt(V[0,0]); b=V[1,0]/a; d=V[2,0]/a; c=jnp.sqrt(V[1,1]-b*b); e=(V[2,1]-d*b)/c; f=jnp.sqrt(V[2,2]-d*d-e*e)
    z=jnp.zeros_like(a)
    i11=1/a; i22=1/c; i33=1/f; i21=-b*i11/c; i32=-e*i22/f; i31=-(d*i11+e*i21)/f
    return jnp.stack([jnp.stack([i11,z,z]),jnp.stack([i21,i22,z]),jnp.stack([i31,i32,i33])])

def _gG(gird,x,c):
    val, pull = jax.vjp(lambda q: _residual(gird,q,c), x)
    G = jnp.stack([pull(jnp.zeros_like(val).at[k].set(1.0))[0] for k in range(3)])
    return val, G

@jax.jit
def _look(gird, s, c, x0, n, want=1):
    def proj(x):
        g,G=_gG(gird,x,c); h=g+jnp.einsum("kan,an->kn",G,s-x)
        W=_inv_chol3(jnp.einsum("kan,lan->kln",G,G)); h=jnp.einsum("kln,ln->kn",W,h)
        h=jnp.einsum("lkn,ln->kn",W,h)
        step=(s-x)-jnp.einsum("kan,kn->an",G,h)
        m=jnp.abs(step).max(0); return x+step*jnp.minimum(1,25.0/jnp.maximum(m,1e-9))
    x=x0
    x=jax.lax.fori_loop(0,n,lambda i,x:proj(x),x)
    g,G=_gG(gird,x,c)
    W=_inv_chol3(jnp.einsum("kan,lan->kln",G,G))
    y=jnp.einsum("kln,ln->kn",W,g+jnp.einsum("kan,an->kn",G,s-x))
    val,pull=jax.vjp(lambda c:_residual(gird,x,c),c)
    T=jnp.stack([pull(jnp.zeros_like(val).at[k].set(1.0))[0] for k in range(3)])
    T=jnp.einsum("kln,ljn->kjn",W,T)
    B=jnp.einsum("kln,lan->kan",W,G)   # whitened dg/dx: nearest x = s - B'y
    return x,y,W,T,B,jnp.abs(g).max(0)

CHUNK=256
def look(gird, s, c, x0=None, n=4):
    """numpy in/out, rows last -> arrays with rows FIRST: x(N,6), y(N,3), W(N,3,3), T(N,3,K), B(N,3,6), gape(N)."""
    N=s.shape[1]; x0=s if x0 is None else x0
    out=[]
    for a in range(0,N,CHUNK):
        sl=slice(a,a+CHUNK); pad=CHUNK-s[:,sl].shape[1]
        p=lambda v: np.pad(v[:,sl],((0,0),(0,pad)),mode="edge")
        r=_look(gird,p(s),p(c),p(x0),n)
        out.append([np.moveaxis(np.asarray(v),-1,0)[:CHUNK-pad] for v in r])
    return [np.concatenate(v) for v in zip(*out)]

@jax.jit
def _pts(centre,axes,points):
    """signed distances (P,L) and slopes (P,5,L) of thorax points for lanes."""
    def f(t): return signed_distance_mm(points[:,:,None]+jnp.zeros((1,1,t.shape[1])), jnp.stack([centre[0]+0*t[0],centre[1]+t[0],centre[2]+t[1]])[:,None], (axes[:,None]+t[2:5])[:,None]) 
    return f
def _make_pts(gird,points):
    @jax.jit
    def f(t):  # t (5,L)
        def d(t):
            return signed_distance_mm(jnp.broadcast_to(points[:,:,None],(3,points.shape[1],t.shape[1])),
                jnp.stack([gird.centre_mm[0]+0*t[0],gird.centre_mm[1]+t[0],gird.centre_mm[2]+t[1]])[:,None],(gird.semi_axes_mm[:,None]+t[2:5])[:,None])
        val=d(t)
        J=jnp.stack([jax.jvp(d,(t,),(jnp.zeros_like(t).at[k].set(1.0),))[1] for k in range(5)])
        return val,J
    return f

@dataclass
class Data:
    s: np.ndarray   # (6,N) deg
    elev: np.ndarray
    tau: np.ndarray  # course coordinate in motion 0..1
    subj: np.ndarray; mot: np.ndarray
    subjects: list; motions: list
    person: np.ndarray # per subject
    @property
    def S(self): return len(self.subjects)

def load(folder="../shared/motions"):
    m=read_motions(*sorted(glob.glob(folder+"/bonepin*.csv")))
    subs=list(m.subjects); mots=sorted(set(m.motion.tolist()))
    subj=np.array([subs.index(x) for x in m.subject.tolist()]); mot=np.array([mots.index(x) for x in m.motion.tolist()])
    tau=np.zeros(len(subj))
    for a in set(zip(subj,mot)):
        r=np.flatnonzero((subj==a[0])&(mot==a[1])); tau[r[np.argsort(m.posture[r],kind="stable")]]=np.linspace(0,1,len(r))
    persons=[n.split("_")[0] for n in subs]; ps=sorted(set(persons))
    return Data(m.angles_deg.T.copy(), m.humerus_elevation_deg.copy(), tau, subj, mot, subs, mots, np.array([ps.index(p) for p in persons]))

class Set:
    def __init__(self,name):
        ps=load_model(name); self.name=name; self.girdle=jax.tree.map(np.asarray,ps.girdle); self.points=ps.points_mm
        self.pts=_make_pts(self.girdle,np.asarray(self.points))
        th=np.asarray(ps.girdle.adapted_mm); self.lo,self.hi=[np.asarray(b)-th for b in ps.bounds_mm]
