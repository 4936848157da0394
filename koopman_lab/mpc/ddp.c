/* Control-limited differential dynamic programming (Tassa, Mansard, Todorov, ICRA 2014) for inputs
 * with box bounds. Stands behind the stage functions that CasADi generates:
 *
 *   ddp_roll(s, u, p)        -> successor, stage cost
 *   ddp_expand(s, u, p, vx)  -> d successor (N x Z), gradient of the cost (Z), second derivatives
 *                               of cost + vx' successor (Z x Z); Z = N + INPUTS, columns one by one
 *   ddp_end(s, p)            -> cost without an input, its gradient (N), its Hessian (N x N)
 *
 * and behind SIZE (N), INPUTS, HORIZON, and the sizes of CasADi's work arrays. The quadratic program
 * of a stage is solved by
 *
 *   make_positive(Q, least)              raises the eigenvalues of Q
 *   box(Q, q, low, high, d, is_free)     minimises 1/2 d' Q d + q' d in a box
 *   feedback(Q, is_free, column, k)      k = -inv(Q) column for the components that are free
 *
 * in closed form for two inputs, and otherwise by iterations.
 *
 * Where the value curves down in an input, either sign of it can be a local minimum, and a horizon
 * has as many as there are combinations. Of these, neighbours of the plan are tried one by one, and
 * a second start. That is so for predictions without reprojection that stray from every state.
 */
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { N = SIZE, Z = N + INPUTS, STEPS = HORIZON, SEARCHES = 10, RAISES = 12, FARTHEST = 3, RECENT = 4 };

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
  double s[STEPS + 1][N], u[STEPS][INPUTS], l[STEPS], value;
} plan_t;

/* Whoever calls brings it, so that several solvers may work at once. */
typedef struct {
  plan_t now, next, best;
  double feed[STEPS][INPUTS], gain[STEPS][INPUTS][N], w[SZ_W + 1];
  casadi_int iw[SZ_IW + 1];
  /* Whether, in the last descent's last iterations, the value curved down in an input. */
  int concave;
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

static double clip(double x, double low, double high) { return fmin(fmax(x, low), high); }

#if INPUTS == 2
#include "ddp_two_inputs.c"
#else
#include "ddp_any_inputs.c"
#endif

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
    double Q[INPUTS][INPUTS], low[INPUTS], high[INPUTS], *d = m->feed[k];
    const double *q = g + N;
    int is_free[INPUTS];
    for (int a = 0; a < INPUTS; ++a) {
      for (int b = 0; b < INPUTS; ++b) Q[a][b] = h[N + a + Z * (N + b)];
      Q[a][a] += weight;
      low[a] = -u_max[a] - u[a];
      high[a] = u_max[a] - u[a];
    }
    *concave |= make_positive(Q, least);
    box(Q, q, low, high, d, is_free);
    for (int i = 0; i < N; ++i) {
      double column[INPUTS];
      feedback(Q, is_free, h + N + Z * i, column);
      for (int a = 0; a < INPUTS; ++a) m->gain[k][a][i] = column[a];
    }
    double slope = 0.0, squares = 0.0, products = 0.0, r[INPUTS];
    for (int a = 0; a < INPUTS; ++a) {
      slope += d[a] * q[a];
      squares += Q[a][a] * d[a] * d[a];
      for (int b = a + 1; b < INPUTS; ++b) products += Q[a][b] * d[a] * d[b];
      /* With r = Q d + q the value's expansion in the state follows. */
      r[a] = Q[a][0] * d[0];
      for (int b = 1; b < INPUTS; ++b) r[a] += Q[a][b] * d[b];
      r[a] += q[a];
    }
    *first += slope;
    *second += 0.5 * squares + products;
    for (int j = 0; j < N; ++j) {
      double gain[INPUTS], rest[INPUTS];
      for (int a = 0; a < INPUTS; ++a) gain[a] = m->gain[k][a][j];
      for (int a = 0; a < INPUTS; ++a) {
        rest[a] = Q[a][0] * gain[0];
        for (int b = 1; b < INPUTS; ++b) rest[a] += Q[a][b] * gain[b];
        rest[a] += h[N + a + Z * j];
      }
      vx[j] = g[j];
      for (int a = 0; a < INPUTS; ++a) vx[j] += gain[a] * r[a];
      for (int a = 0; a < INPUTS; ++a) vx[j] += h[N + a + Z * j] * d[a];
      for (int i = 0; i <= j; ++i) {
        double sum = h[i + Z * j];
        for (int a = 0; a < INPUTS; ++a) sum += m->gain[k][a][i] * rest[a];
        for (int a = 0; a < INPUTS; ++a) sum += h[N + a + Z * i] * gain[a];
        vxx[i + N * j] = sum;
      }
    }
    for (int j = 0; j < N; ++j)
      for (int i = 0; i < j; ++i) vxx[j + N * i] = vxx[i + N * j];
  }
}

/* The input at stage k of now, corrected for what next's state differs by. */
static void follow(work_t *m, const double *u_max, int k, double share) {
  for (int j = 0; j < INPUTS; ++j) {
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
    for (int j = 0; j < INPUTS; ++j)
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
  for (int iteration = 1; iteration <= most; ++iteration) {
    const double value = m->now.value;
    double first, second, share = 1.0;
    int accepted = 0, concave;
    backward(m, p, u_max, weight, &first, &second, &concave);
    late = concave ? RECENT : late - 1;
    m->concave = late > 0;
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
    for (int j = 0; j < INPUTS; ++j) m->now.u[k][j] = share * inputs[INPUTS * k + j];
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

/* Improve inputs (STEPS x INPUTS). Return the number of iterations, negative if they did not suffice. */
int ddp_solve(void *work, const double *s0, const double *p, const double *u_max, double tolerance,
              int most, double *inputs) {
  work_t *m = work;
  memset(m, 0, sizeof *m);
  int count = improve(m, s0, p, u_max, tolerance, most, 1.0, inputs), spent = abs(count);
  m->best = m->now;
  if (m->concave && spent < most) {
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
