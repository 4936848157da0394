/* The quadratic program of a stage for two inputs, in closed form; see ddp.c. */

/* Raise the eigenvalues of Q to their magnitudes, and to the least one at least. Tell whether one was
 * negative. */
static int make_positive(double Q[2][2], double least) {
  const double a = Q[0][0], b = Q[0][1], c = Q[1][1];
  const double mean = 0.5 * (a + c), half = 0.5 * (a - c), radius = hypot(half, b);
  const double low = mean - radius, high = mean + radius;
  const double new_low = fmax(fabs(low), least), new_high = fmax(fabs(high), least);
  if (low == new_low && high == new_high) return 0;
  const double new_mean = 0.5 * (new_low + new_high);
  const double scale = radius > 0.0 ? 0.5 * (new_high - new_low) / radius : 0.0;
  Q[0][0] = new_mean + scale * half;
  Q[1][1] = new_mean - scale * half;
  Q[0][1] = Q[1][0] = b * scale;
  return low < 0.0;
}

/* Minimise 1/2 d' Q d + q' d in a box; tell which components are off its bounds. */
static void box(double Q[2][2], const double *q, const double *low, const double *high, double *d,
                int *is_free) {
  const double det = Q[0][0] * Q[1][1] - Q[0][1] * Q[0][1];
  d[0] = (Q[0][1] * q[1] - Q[1][1] * q[0]) / det;
  d[1] = (Q[0][1] * q[0] - Q[0][0] * q[1]) / det;
  is_free[0] = is_free[1] = 1;
  if (d[0] >= low[0] && d[0] <= high[0] && d[1] >= low[1] && d[1] <= high[1]) return;
  double best = INFINITY;
  for (int i = 0; i < 2; ++i) {
    const int j = 1 - i;
    for (int upper = 0; upper < 2; ++upper) {
      const double x = upper ? high[i] : low[i], y_free = -(q[j] + Q[0][1] * x) / Q[j][j];
      const double y = clip(y_free, low[j], high[j]);
      const double cost = 0.5 * (Q[i][i] * x * x + Q[j][j] * y * y) + Q[0][1] * x * y +
                          q[i] * x + q[j] * y;
      if (cost < best) {
        best = cost;
        d[i] = x;
        d[j] = y;
        is_free[i] = 0;
        is_free[j] = y == y_free;
      }
    }
  }
}

/* k = -inv(Q) column for the components that are free, zero for the others. */
static void feedback(double Q[2][2], const int *is_free, const double *column, double *k) {
  const double a = Q[0][0], b = Q[0][1], c = Q[1][1];
  k[0] = k[1] = 0.0;
  if (is_free[0] && is_free[1]) {
    const double det = a * c - b * b;
    k[0] = (b * column[1] - c * column[0]) / det;
    k[1] = (b * column[0] - a * column[1]) / det;
  } else if (is_free[0]) {
    k[0] = -column[0] / a;
  } else if (is_free[1]) {
    k[1] = -column[1] / c;
  }
}
