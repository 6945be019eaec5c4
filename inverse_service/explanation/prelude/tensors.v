
(* Variable 0 is the time, then come `size` coordinates and as many velocities. *)
Definition partial (v : nat) : poly -> poly := derive (slope v).
(* Along the motion: d/dt + v^i d/dq^i + f^i d/dv^i. *)
Definition along (p : poly) : poly :=
  (partial 0 p + sum size (fun i => velocity i * partial (1 + i) p) +
   sum size (fun i => f i * partial (1 + size + i) p))%poly.
Definition by_velocity (i j : nat) : poly := partial (1 + size + j) (f i).
(* N = -1/2 df/dv, Phi = Gamma(df/dv) - 2 df/dq - 1/2 (df/dv)(df/dv), nabla T = Gamma(T) + N T - T N. *)
Definition N (i j : nat) : poly := scale (-1 # 2) (by_velocity i j).
Definition Phi (i j : nat) : poly :=
  (along (by_velocity i j) - (scale (2 # 1) (partial (1 + j) (f i)) +
   scale (1 # 2) (sum size (fun m => by_velocity i m * by_velocity m j))))%poly.
Definition nabla (T : nat -> nat -> poly) (i j : nat) : poly :=
  (along (T i j) + sum size (fun m => N i m * T m j) - sum size (fun m => T i m * N m j))%poly.
(* R[T]^i_kl = dT^i_k/dv^l - dT^i_l/dv^k, and nabla of such a tensor. *)
Definition curvature (T : nat -> nat -> poly) (i k l : nat) : poly :=
  (partial (1 + size + l) (T i k) - partial (1 + size + k) (T i l))%poly.
Definition nabla_R (T : nat -> nat -> nat -> poly) (i k l : nat) : poly :=
  (along (T i k l) + sum size (fun m => N i m * T m k l) -
   sum size (fun m => T i m l * N m k) - sum size (fun m => T i k m * N m l))%poly.
