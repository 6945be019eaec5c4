(* What is proven: the theorems at the end, for all real numbers that fulfil their hypotheses. The
   accelerations f, the derivation along the motion, and the tensors are defined below and computed by Coq. *)
Require Import Reals Lra QArith Qreals List.
Import ListNotations.
Module Motion.

(* Polynomials in generators numbered 0, 1, 2, ...: sorted lists of exponents with their coefficients. *)
Definition poly := list (list nat * Q).
Declare Scope poly_scope.
Delimit Scope poly_scope with poly.
Bind Scope poly_scope with poly.
Fixpoint order (a b : list nat) : comparison :=
  match a, b with
  | [], [] => Eq
  | [], _ => Lt
  | _, [] => Gt
  | d :: a', e :: b' => match Nat.compare d e with Eq => order a' b' | c => c end
  end.
Fixpoint plus_term (m : list nat) (c : Q) (p : poly) : poly :=
  match p with
  | [] => if Qeq_bool c 0 then [] else [(m, c)]
  | (n, d) :: p' =>
      match order m n with
      | Eq => if Qeq_bool (c + d) 0 then p' else (n, Qred (c + d)) :: p'
      | Gt => (m, c) :: p
      | Lt => (n, d) :: plus_term m c p'
      end
  end.
Definition add (p q : poly) : poly := fold_right (fun t => plus_term (fst t) (snd t)) q p.
Definition scale (c : Q) (p : poly) : poly := map (fun t => (fst t, Qred (c * snd t))) p.
Definition sub (p q : poly) : poly := add p (scale (-1) q).
Fixpoint product (a b : list nat) : list nat :=
  match a, b with [], _ => b | _, [] => a | d :: a', e :: b' => (d + e)%nat :: product a' b' end.
Definition mul (p q : poly) : poly :=
  fold_right (fun t => add (map (fun u => (product (fst t) (fst u), Qred (snd t * snd u))) q)) [] p.
Definition num (c : Q) : poly := plus_term [] c [].
Definition var (k : nat) : poly := [(repeat 0%nat k ++ [1%nat], 1)].
Fixpoint power (p : poly) (e : nat) : poly := match e with O => num 1 | S d => mul p (power p d) end.
Fixpoint sum (n : nat) (h : nat -> poly) : poly := match n with O => [] | S m => add (sum m h) (h m) end.
(* The generators of a product of powers, each with its exponent and the product with this exponent lowered by one. *)
Definition before (e : nat) (m : list nat) := match e, m with O, [] => [] | _, _ => e :: m end.
Fixpoint lowered (k : nat) (m : list nat) : list (nat * nat * list nat) :=
  match m with
  | [] => []
  | e :: m' =>
      match e with O => [] | S d => [(k, e, before d m')] end ++
      map (fun t => (fst t, before e (snd t))) (lowered (S k) m')
  end.
(* The derivation that takes generator k to s(k): the sum over k of (dp/dk) s(k). *)
Definition derive (s : nat -> poly) (p : poly) : poly :=
  fold_right (fun t => add (fold_right (fun u =>
    add (mul [(snd u, Qred (snd t * inject_Z (Z.of_nat (snd (fst u)))))] (s (fst (fst u)))))
    [] (lowered 0 (fst t)))) [] p.
Infix "+" := add : poly_scope.
Infix "-" := sub : poly_scope.
Infix "*" := mul : poly_scope.
Infix "^" := power : poly_scope.
Close Scope Q_scope.
Open Scope R_scope.
(* The value where the generators have the values r. *)
Fixpoint monomial (r : nat -> R) (k : nat) (m : list nat) : R :=
  match m with [] => 1 | e :: m' => r k ^ e * monomial r (S k) m' end.
Definition value (r : nat -> R) (p : poly) : R :=
  fold_right (fun t => Rplus (Q2R (snd t) * monomial r 0%nat (fst t))) 0 p.
