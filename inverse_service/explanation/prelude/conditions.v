(* (T)_ik: g T is symmetric. (T)_ikl: the cyclic sum of g_ij T^j_kl. *)
Definition symmetric (T : nat -> nat -> poly) (i k : nat) : poly :=
  (sum size (fun j => g i j * T j k) - sum size (fun j => g k j * T j i))%poly.
Definition cyclic (T : nat -> nat -> nat -> poly) (i k l : nat) : poly :=
  sum size (fun j => g i j * T j k l + g l j * T j i k + g k j * T j l i)%poly.
