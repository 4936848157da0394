/* Control-limited differential dynamic programming (Tassa, Mansard, Todorov, ICRA 2014) for two
 * inputs with box bounds. Stands behind the stage functions that CasADi generates:
 *
 *   ddp_roll(s, u, p)        -> successor, stage cost
 *   ddp_expand(s, u, p, vx)  -> d successor (N x Z), gradient of the cost (Z), second derivatives
 *                               of cost + vx' successor (Z x Z); Z = N + 2, columns one by one
 *   ddp_end(s, p)            -> cost without an input, its gradient (N), its Hessian (N x N)
 *
 * and behind SIZE (N), HORIZON, and the sizes of CasADi's work arrays.
 *
 * Where the value curves down in an input, either sign of it can be a local minimum, and a horizon
 * has as many as there are combinations. Of these, neighbours of the plan are tried one by one, and
 * a second start. That is so for predictions without reprojection that stray from every state.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = SIZE, Z = N + 2, STEPS = HORIZON, SEARCHES = 10, RAISES = 12, FARTHEST = 3, RECENT = 4 };

/* What a look at all neighbours takes, in iterations. */
enum { LOOK = 4 };

/* Of the present value: least curvature, and weights that keep a step small after a failed one. */
static const double SMALLEST_CURVATURE = 1e-9, FIRST_WEIGHT = 1e-3, LAST_WEIGHT = 1e-6;
/* Share of the expected decrease that a step must bring. */
static const double SUFFICIENT = 1e-4;
/* Of the present value: least gain by which a neighbour replaces a plan. */
static const double NOTICEABLE = 1e-7;
/* What the second start leaves of the guess: it lies off the bounds. */
static const double INSIDE = 0.9;

typedef struct {
  double s[STEPS + 1][N], u[STEPS][2], l[STEPS], value;
} plan_t;

/* Whoever calls brings it, so that several solvers may work at once. */
typedef struct {
  plan_t now, next, best;
  double feed[STEPS][2], gain[STEPS][2][N], w[SZ_W + 1];
  casadi_int iw[SZ_IW + 1];
  /* Whether the value curved down in an input: in the last descent, and in its last iterations. */
  int concave, concave_late;
} work_t;

int ddp_work_size(void) { return sizeof(work_t); }

static void roll(work_t *m, const double *s, const double *u, const double *p, double *following, double *l) {
  const double *arg[SZ_ARG + 1] = {s, u, p};
  double *res[SZ_RES + 1] = {following, l};
  ddp_roll(arg, res, m->iw, m->w, 0);
}

static void expand(work_t *m, const double *s, const double *u, const double *p, const double *vx, double *f,
                   double *g, double *h) {
  const double *arg[SZ_ARG + 1] = {s, u, p, vx};
  double *res[SZ_RES + 1] = {f, g, h};
  ddp_expand(arg, res, m->iw, m->w, 0);
}

static double end(work_t *m, const double *s, const double *p, double *g, double *h) {
  const double *arg[SZ_ARG + 1] = {s, p};
  double l, *res[SZ_RES + 1] = {&l, g, h};
  ddp_end(arg, res, m->iw, m->w, 0);
  return l;
}

/* Raise the eigenvalues of [[a, b], [b, c]] to their magnitudes, and to the least one at least. Tell
 * whether one was negative. */
static int make_positive(double *a, double *b, double *c, double least) {
  const double mean = 0.5 * (*a + *c), half = 0.5 * (*a - *c), radius = hypot(half, *b);
  const double low = mean - radius, high = mean + radius;
  const double new_low = fmax(fabs(low), least), new_high = fmax(fabs(high), least);
  if (low == new_low && high == new_high) return 0;
  const double new_mean = 0.5 * (new_low + new_high);
  const double scale = radius > 0.0 ? 0.5 * (new_high - new_low) / radius : 0.0;
  *a = new_mean + scale * half;
  *c = new_mean - scale * half;
  *b *= scale;
  return low < 0.0;
}

static double clip(double x, double low, double high) { return fmin(fmax(x, low), high); }

/* Minimise 1/2 d' Q d + q' d in a box; tell which components are off its bounds. */
static void box(const double Q[2][2], const double q[2], const double low[2], const double high[2],
                double d[2], int is_free[2]) {
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

/* Fill feed and gain; give the first and second order of the expected change of the value, and
 * whether it curves down in an input. */
static void backward(work_t *m, const double *p, const double *u_max, double weight, double *first,
                     double *second, int *concave) {
  double vx[N], vxx[N * N], f[N * Z], g[Z], h[Z * Z], t[N * Z];
  const double least = SMALLEST_CURVATURE * m->now.value / STEPS;
  end(m, m->now.s[STEPS], p, vx, vxx);
  *first = *second = 0.0;
  *concave = 0;
  for (int k = STEPS - 1; k >= 0; --k) {
    const double *u = m->now.u[k];
    expand(m, m->now.s[k], u, p, vx, f, g, h);
    /* g += f' vx, h += f' vxx f; both are symmetric. */
    for (int j = 0; j < Z; ++j)
      for (int i = 0; i < N; ++i) {
        double sum = 0.0;
        for (int l = 0; l < N; ++l) sum += vxx[i + N * l] * f[l + N * j];
        t[i + N * j] = sum;
      }
    for (int j = 0; j < Z; ++j) {
      for (int l = 0; l < N; ++l) g[j] += f[l + N * j] * vx[l];
      for (int i = 0; i <= j; ++i) {
        double sum = 0.0;
        for (int l = 0; l < N; ++l) sum += f[l + N * i] * t[l + N * j];
        h[i + Z * j] += sum;
        h[j + Z * i] = h[i + Z * j];
      }
    }
    double a = h[N + Z * N] + weight, b = h[N + Z * (N + 1)], c = h[N + 1 + Z * (N + 1)] + weight;
    *concave |= make_positive(&a, &b, &c, least);
    const double Q[2][2] = {{a, b}, {b, c}}, *q = g + N;
    const double low[2] = {-u_max[0] - u[0], -u_max[1] - u[1]};
    const double high[2] = {u_max[0] - u[0], u_max[1] - u[1]};
    double *d = m->feed[k];
    int is_free[2];
    box(Q, q, low, high, d, is_free);
    const double det = a * c - b * b;
    for (int i = 0; i < N; ++i) {
      const double q0 = h[N + Z * i], q1 = h[N + 1 + Z * i];
      double k0 = 0.0, k1 = 0.0;
      if (is_free[0] && is_free[1]) {
        k0 = (b * q1 - c * q0) / det;
        k1 = (b * q0 - a * q1) / det;
      } else if (is_free[0]) {
        k0 = -q0 / a;
      } else if (is_free[1]) {
        k1 = -q1 / c;
      }
      m->gain[k][0][i] = k0;
      m->gain[k][1][i] = k1;
    }
    *first += d[0] * q[0] + d[1] * q[1];
    *second += 0.5 * (a * d[0] * d[0] + c * d[1] * d[1]) + b * d[0] * d[1];
    /* With r = Q d + q the value's expansion in the state follows. */
    const double r0 = a * d[0] + b * d[1] + q[0], r1 = b * d[0] + c * d[1] + q[1];
    for (int j = 0; j < N; ++j) {
      const double k0 = m->gain[k][0][j], k1 = m->gain[k][1][j];
      const double q0 = h[N + Z * j], q1 = h[N + 1 + Z * j];
      const double m0 = a * k0 + b * k1 + q0, m1 = b * k0 + c * k1 + q1;
      vx[j] = g[j] + k0 * r0 + k1 * r1 + q0 * d[0] + q1 * d[1];
      for (int i = 0; i <= j; ++i)
        vxx[i + N * j] = h[i + Z * j] + m->gain[k][0][i] * m0 + m->gain[k][1][i] * m1 +
                         h[N + Z * i] * k0 + h[N + 1 + Z * i] * k1;
    }
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < j; ++i) vxx[j + N * i] = vxx[i + N * j];
  }
}

/* The input at stage k of now, corrected for what next's state differs by. */
static void follow(work_t *m, const double *u_max, int k, double share) {
  for (int j = 0; j < 2; ++j) {
    double u = m->now.u[k][j] + share * m->feed[k][j];
    for (int i = 0; i < N; ++i) u += m->gain[k][j][i] * (m->next.s[k][i] - m->now.s[k][i]);
    m->next.u[k][j] = clip(u, -u_max[j], u_max[j]);
  }
}

/* Simulate a share of the change into next. */
static void forward(work_t *m, const double *p, const double *u_max, double share) {
  memcpy(m->next.s[0], m->now.s[0], sizeof m->next.s[0]);
  m->next.value = 0.0;
  for (int k = 0; k < STEPS; ++k) {
    follow(m, u_max, k, share);
    roll(m, m->next.s[k], m->next.u[k], p, m->next.s[k + 1], &m->next.l[k]);
    m->next.value += m->next.l[k];
  }
  m->next.value += end(m, m->next.s[STEPS], p, 0, 0);
}

/* Simulate what follows if the inputs of stages first to last are next's. Make it the present plan
 * if it costs less. */
static int adopt(work_t *m, const double *p, const double *u_max, int first, int last) {
  double value = 0.0;
  for (int k = 0; k < first; ++k) value += m->now.l[k];
  memcpy(m->next.s[first], m->now.s[first], sizeof m->now.s[first]);
  for (int k = first; k < STEPS; ++k) {
    if (k > last) follow(m, u_max, k, 0.0);
    roll(m, m->next.s[k], m->next.u[k], p, m->next.s[k + 1], &m->next.l[k]);
    value += m->next.l[k];
    if (!(value < m->now.value)) return 0;
  }
  value += end(m, m->next.s[STEPS], p, 0, 0);
  if (!(value < m->now.value * (1.0 - NOTICEABLE))) return 0;
  const int stages = STEPS - first;
  memcpy(m->now.s[first], m->next.s[first], (stages + 1) * sizeof m->now.s[0]);
  memcpy(m->now.u[first], m->next.u[first], stages * sizeof m->now.u[0]);
  memcpy(m->now.l + first, m->next.l + first, stages * sizeof m->now.l[0]);
  m->now.value = value;
  return 1;
}

/* Turn each input round, and exchange it with those shortly after it. Tell whether that helped. */
static int rearrange(work_t *m, const double *p, const double *u_max) {
  int found = 0;
  for (int k = 0; k < STEPS; ++k)
    for (int j = 0; j < 2; ++j)
      for (int other = k; other < STEPS && other <= k + FARTHEST; ++other) {
        const double here = m->now.u[k][j], there = m->now.u[other][j];
        if (other > k && here == there) continue;
        memcpy(m->next.u[k], m->now.u[k], (other - k + 1) * sizeof m->now.u[0]);
        m->next.u[k][j] = other > k ? there : -here;
        if (other > k) m->next.u[other][j] = here;
        found |= adopt(m, p, u_max, k, other);
      }
  return found;
}

/* Improve now by Newton's method. Return the number of iterations, negative if they did not
 * suffice. */
static int descend(work_t *m, const double *p, const double *u_max, double tolerance, int most) {
  double weight = 0.0;
  int raises = 0, late = 0;
  m->concave = 0;
  for (int iteration = 1; iteration <= most; ++iteration) {
    const double value = m->now.value;
    double first, second, share = 1.0;
    int accepted = 0, concave;
    backward(m, p, u_max, weight, &first, &second, &concave);
    late = concave ? RECENT : late - 1;
    m->concave |= concave;
    m->concave_late = late > 0;
    for (int search = 0; search < SEARCHES && !accepted; ++search, share *= 0.5) {
      forward(m, p, u_max, share);
      accepted = m->next.value <= value + SUFFICIENT * share * (first + share * second);
    }
    if (accepted) m->now = m->next;
    if (weight == 0.0 && -(first + second) <= tolerance * value) return iteration;
    if (accepted) {
      raises = 0;
      weight = weight > LAST_WEIGHT * value ? 0.1 * weight : 0.0;
    } else {
      if (++raises > RAISES) return -iteration;
      weight = fmax(10.0 * weight, FIRST_WEIGHT * value / STEPS);
    }
  }
  return -most;
}

/* Improve a share of the inputs; where many minima are close, go on from neighbours. Return as
 * descend does. */
static int improve(work_t *m, const double *s0, const double *p, const double *u_max,
                   double tolerance, int most, double share, const double *inputs) {
  memset(m->feed, 0, sizeof m->feed);
  memset(m->gain, 0, sizeof m->gain);
  memcpy(m->now.s[0], s0, sizeof m->now.s[0]);
  for (int k = 0; k < STEPS; ++k)
    for (int j = 0; j < 2; ++j) m->now.u[k][j] = share * inputs[2 * k + j];
  /* With nothing to change, this simulates the guess. */
  forward(m, p, u_max, 0.0);
  m->now = m->next;
  if (m->now.value == 0.0) return 0;
  int count = descend(m, p, u_max, tolerance, most), spent = abs(count);
  for (most -= LOOK; m->concave && spent < most && rearrange(m, p, u_max); most -= LOOK) {
    count = descend(m, p, u_max, tolerance, most - spent);
    spent += abs(count);
  }
  return count < 0 ? -spent : spent;
}

/* Improve inputs (STEPS x 2). Return the number of iterations, negative if they did not suffice. */
int ddp_solve(void *work, const double *s0, const double *p, const double *u_max, double tolerance,
              int most, double *inputs) {
  work_t *m = work;
  memset(m, 0, sizeof *m);
  int count = improve(m, s0, p, u_max, tolerance, most, 1.0, inputs), spent = abs(count);
  m->best = m->now;
  if (m->concave_late && spent < most) {
    const int more = improve(m, s0, p, u_max, tolerance, most - spent, INSIDE, inputs);
    spent += abs(more);
    if (m->now.value < m->best.value) {
      m->best = m->now;
      count = more;
    }
  }
  memcpy(inputs, m->best.u, sizeof m->best.u);
  return count < 0 ? -spent : spent;
}
