"""One card a question: which unknown functions, which equations, which matrix has to reach which rank."""
