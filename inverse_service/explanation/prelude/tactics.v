Ltac computed H := match type of H with value _ ?p = _ =>
  let q := eval vm_compute in p in replace p with q in H by (vm_compute; reflexivity) end;
  cbv [value monomial fold_right fst snd point Q2R Qnum Qden] in H.
Ltac compute_goal := match goal with |- value _ ?p = _ =>
  let q := eval vm_compute in p in replace p with q by (vm_compute; reflexivity) end;
  cbv [value monomial fold_right fst snd point Q2R Qnum Qden].
End Motion.
Open Scope R_scope.
