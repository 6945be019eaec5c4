(* d/dt (dL/dv^i) - dL/dq^i along the motion. *)
Definition euler_lagrange (i : nat) : poly := (along (partial (1 + size + i) L) - partial (1 + i) L)%poly.
