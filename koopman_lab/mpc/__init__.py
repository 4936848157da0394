"""Model predictive control: stage costs, optimal control problem, solvers, receding horizon."""
