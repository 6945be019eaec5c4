Lemma cancel (f a : R) : f <> 0 -> f * a = 0 -> a = 0.
Proof. intros H P; destruct (Rmult_integral _ _ P); [contradiction | assumption]. Qed.
Lemma plus_zero (a b : R) : a = 0 -> b = 0 -> a + b = 0.
Proof. intros -> ->; ring. Qed.
Lemma times_zero (a b : R) : b = 0 -> a * b = 0.
Proof. intros ->; ring. Qed.
Ltac nonzero := repeat split; repeat (assumption || apply Rmult_integral_contrapositive_currified ||
  apply pow_nonzero || lra).
Ltac zero := repeat (reflexivity || assumption || apply times_zero || apply plus_zero).
