/* The quadratic program of a stage for any number of inputs; see ddp.c. */

enum { SWEEPS = 50, NEWTON_STEPS = 100, HALVINGS = 40 };

/* Share of the expected decrease that a step along the box must bring. */
static const double SUFFICIENT_IN_BOX = 0.1;

/* Turn the symmetric matrix A into a diagonal one by Jacobi's rotations, collected in V: A = V D V'. */
static void diagonalise(double A[INPUTS][INPUTS], double V[INPUTS][INPUTS]) {
  for (int i = 0; i < INPUTS; ++i)
    for (int j = 0; j < INPUTS; ++j) V[i][j] = i == j;
  for (int sweep = 0; sweep < SWEEPS; ++sweep) {
    double off = 0.0, on = 0.0;
    for (int i = 0; i < INPUTS; ++i)
      for (int j = 0; j < INPUTS; ++j) *(i == j ? &on : &off) += A[i][j] * A[i][j];
    if (!(off > 1e-32 * on)) return;
    for (int p = 0; p < INPUTS; ++p)
      for (int q = p + 1; q < INPUTS; ++q) {
        if (A[p][q] == 0.0) continue;
        const double theta = 0.5 * (A[q][q] - A[p][p]) / A[p][q];
        const double t = (theta < 0.0 ? -1.0 : 1.0) / (fabs(theta) + hypot(theta, 1.0));
        const double c = 1.0 / hypot(t, 1.0), s = t * c;
        for (int k = 0; k < INPUTS; ++k) {
          const double x = A[k][p], y = A[k][q];
          A[k][p] = c * x - s * y;
          A[k][q] = s * x + c * y;
        }
        for (int k = 0; k < INPUTS; ++k) {
          const double x = A[p][k], y = A[q][k];
          A[p][k] = c * x - s * y;
          A[q][k] = s * x + c * y;
        }
        for (int k = 0; k < INPUTS; ++k) {
          const double x = V[k][p], y = V[k][q];
          V[k][p] = c * x - s * y;
          V[k][q] = s * x + c * y;
        }
      }
  }
}

/* Raise the eigenvalues of Q to their magnitudes, and to the least one at least. Tell whether one was
 * negative. */
static int make_positive(double Q[INPUTS][INPUTS], double least) {
  double D[INPUTS][INPUTS], V[INPUTS][INPUTS], raised[INPUTS];
  memcpy(D, Q, sizeof D);
  diagonalise(D, V);
  int changed = 0, negative = 0;
  for (int i = 0; i < INPUTS; ++i) {
    raised[i] = fmax(fabs(D[i][i]), least);
    changed |= raised[i] != D[i][i];
    negative |= D[i][i] < 0.0;
  }
  if (!changed) return 0;
  for (int i = 0; i < INPUTS; ++i)
    for (int j = 0; j <= i; ++j) {
      double sum = 0.0;
      for (int k = 0; k < INPUTS; ++k) sum += V[i][k] * raised[k] * V[j][k];
      Q[i][j] = Q[j][i] = sum;
    }
  return negative;
}

/* k = -inv(Q) column for the components that are free, zero for the others; by Cholesky's factor. */
static void feedback(double Q[INPUTS][INPUTS], const int *is_free, const double *column, double *k) {
  double L[INPUTS][INPUTS], x[INPUTS];
  int at[INPUTS], count = 0;
  for (int i = 0; i < INPUTS; ++i) {
    k[i] = 0.0;
    if (is_free[i]) at[count++] = i;
  }
  for (int i = 0; i < count; ++i) {
    for (int j = 0; j <= i; ++j) {
      double sum = Q[at[i]][at[j]];
      for (int l = 0; l < j; ++l) sum -= L[i][l] * L[j][l];
      L[i][j] = i == j ? sqrt(sum) : sum / L[j][j];
    }
    x[i] = -column[at[i]];
    for (int l = 0; l < i; ++l) x[i] -= L[i][l] * x[l];
    x[i] /= L[i][i];
  }
  for (int i = count - 1; i >= 0; --i) {
    for (int l = i + 1; l < count; ++l) x[i] -= L[l][i] * x[l];
    x[i] /= L[i][i];
    k[at[i]] = x[i];
  }
}

/* What 1/2 d' Q d + q' d comes to; also its gradient r. */
static double quadratic(double Q[INPUTS][INPUTS], const double *q, const double *d, double *r) {
  double value = 0.0;
  for (int i = 0; i < INPUTS; ++i) {
    r[i] = q[i];
    for (int j = 0; j < INPUTS; ++j) r[i] += Q[i][j] * d[j];
    value += 0.5 * d[i] * (r[i] + q[i]);
  }
  return value;
}

/* Minimise 1/2 d' Q d + q' d in a box that holds zero; tell which components are off its bounds.
 * Newton's method in the components that no bound holds back, projected to the box (Bertsekas, SIAM
 * Journal on Control and Optimization 20, 1982): a full step with the right components ends it. */
static void box(double Q[INPUTS][INPUTS], const double *q, const double *low, const double *high,
                double *d, int *is_free) {
  double r[INPUTS], step[INPUTS], next[INPUTS], next_r[INPUTS];
  for (int i = 0; i < INPUTS; ++i) d[i] = is_free[i] = 0;
  double value = quadratic(Q, q, d, r);
  for (int n = 0, solved = 0; n < NEWTON_STEPS; ++n) {
    int changed = 0;
    for (int i = 0; i < INPUTS; ++i) {
      const int off = !((d[i] <= low[i] && r[i] > 0.0) || (d[i] >= high[i] && r[i] < 0.0));
      changed |= off != is_free[i];
      is_free[i] = off;
    }
    if (solved && !changed) return;
    feedback(Q, is_free, r, step);
    solved = 1;
    for (int i = 0; i < INPUTS; ++i) {
      next[i] = d[i] + step[i];
      solved &= next[i] >= low[i] && next[i] <= high[i];
    }
    double share = 1.0, next_value = 0.0;
    for (int h = 0; h < HALVINGS; ++h, share *= 0.5) {
      double expected = 0.0;
      for (int i = 0; i < INPUTS; ++i) {
        next[i] = clip(d[i] + share * step[i], low[i], high[i]);
        expected += r[i] * (next[i] - d[i]);
      }
      next_value = quadratic(Q, q, next, next_r);
      if (solved || next_value <= value + SUFFICIENT_IN_BOX * expected) break;
    }
    memcpy(d, next, sizeof next);
    memcpy(r, next_r, sizeof next_r);
    value = next_value;
    if (!isfinite(value)) return;
  }
}
