"""Stage costs, optimal control problem, solvers, receding horizon."""
