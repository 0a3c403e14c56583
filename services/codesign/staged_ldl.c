/* Symmetric indefinite factorisation, stage by stage: L D L' of the systems that IPOPT solves at every iteration.
 *
 * The unknowns are eliminated in stages, the intervals of the motion; what a stage leaves behind is a small dense
 * matrix over the unknowns that it shares with later ones (the state at the interval's end, the design and t_f). So
 * every stage is a dense "front": assemble the matrix entries of the stage, add what the stage before left, eliminate
 * the stage's own unknowns, hand on the rest (Duff & Reid 1983, the multifrontal method, on a chain).
 *
 * In a front come first the pairs: a variable and the one sparse constraint that fixes it (a voltage and its motor
 * equation, a slack and its inequality). Their 2x2 pivots [S g; g c] with c = 0 cost a few scalar operations. Then the
 * candidates, eliminated with threshold pivoting in 1x1 and 2x2 steps (Duff & Reid 1996, section 2); a candidate
 * without an acceptable pivot is delayed to the next stage. Last the boundary, which belongs to later stages.
 *
 * Stages come in chains. What the stages of a chain leave behind, the last of them hands to the trunk, the last chain;
 * so all chains but the trunk are eliminated side by side, by several threads (the motions of the program of all tasks,
 * with the design in the trunk). The trunk adds up what they left in their order, whichever thread was first: the
 * numbers do not depend on how many threads there are.
 *
 * IPOPT finds this library as `hsllib` and calls it by the names of MA27. Everything between two calls lives in the
 * arrays that the caller owns, so there is nothing to free. The order of elimination is not found here: it is handed
 * over beforehand with `staged_ldl_order` (elimination.py).
 *
 * "Index" is an unknown as the caller counts, "position" its place in the order of elimination, "slot" its place in
 * a front. Fronts are stored by columns, lower triangle only.
 */

#include <float.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define LANES 8       /* doubles in a vector; wider than the machine's is split by the compiler */
#define TILE_COLUMNS 4
#define TILE_ROWS (3 * LANES)

typedef double vector __attribute__((vector_size(8 * LANES), aligned(8)));

/* Largest entry of a pair's constraint row over the entry that the pair is eliminated by. */
static const double PAIR_GROWTH = 1e3;

/* A pivot this small is zero. */
static const double ZERO = 1e-20;

enum { FAILED_SIZE = -1, NO_INTEGER_SPACE = -3, NO_REAL_SPACE = -4, SINGULAR = -5 };

/* ---- the order of elimination, as handed over ---- */

static struct {
  int n, stages, chains;
  int *order; /* (n) index at each position */
  int *first; /* (stages + 1) position at which each stage begins */
  int *pairs; /* (stages) number of pairs at the beginning of each stage: variable, constraint, variable, ... */
  int *chain; /* (chains) stage at which each chain begins; the last chain is the trunk */
  int threads; /* how many eliminate chains */
  int refused; /* systems of another size that came since */
} handed;

static int handed_size(int n, int stages, int chains) { return n + 2 * stages + 1 + chains; }

/* Hand over the order for the systems that follow. Returns 0, or 1 when there is no memory. */
int staged_ldl_order(int n, int stages, int chains, const int *order, const int *first, const int *pairs,
                     const int *chain, int threads) {
  int *room = malloc(sizeof(int) * (size_t)handed_size(n, stages, chains));
  if (!room) return 1;
  free(handed.order);
  handed.n = n;
  handed.stages = stages;
  handed.chains = chains;
  handed.threads = threads;
  handed.refused = 0;
  handed.order = room;
  handed.first = handed.order + n;
  handed.pairs = handed.first + stages + 1;
  handed.chain = handed.pairs + stages;
  memcpy(handed.order, order, sizeof(int) * (size_t)n);
  memcpy(handed.first, first, sizeof(int) * (size_t)(stages + 1));
  memcpy(handed.pairs, pairs, sizeof(int) * (size_t)stages);
  memcpy(handed.chain, chain, sizeof(int) * (size_t)chains);
  return 0;
}

/* How many systems came since that the order does not fit. */
int staged_ldl_refused(void) { return handed.refused; }

/* ---- threads ---- */

typedef struct {
  void (*work)(void *context, int item, int thread);
  void *context;
  int items;
  atomic_int next;
} Team;

typedef struct {
  Team *team;
  int thread;
} Member;

static void *serve(void *argument) {
  const Member *member = argument;
  Team *team = member->team;
  for (int item; (item = atomic_fetch_add(&team->next, 1)) < team->items;)
    team->work(team->context, item, member->thread);
  return NULL;
}

enum { MOST_THREADS = 64 };

/* Do the work for every item, in any order, with up to `threads` threads; with fewer where no more can be had. */
static void for_each(int items, int threads, void (*work)(void *, int, int), void *context) {
  Team team = {work, context, items, 0};
  Member members[MOST_THREADS];
  pthread_t started[MOST_THREADS];
  int count = threads < items ? threads : items;
  if (count > MOST_THREADS) count = MOST_THREADS;
  for (int t = 0; t < count; t++) members[t] = (Member){&team, t};
  int running = 1;
  while (running < count && !pthread_create(&started[running], NULL, serve, &members[running])) running++;
  if (count > 0) serve(&members[0]);
  for (int t = 1; t < running; t++) pthread_join(started[t], NULL);
}

/* ---- the plan: which entry goes where, found once for a pattern ---- */

typedef struct {
  int n, nz, stages, chains;
  const int *order, *first, *pairs, *chain; /* as handed over */
  int *position;       /* (n) of each index */
  int *first_entry;    /* (stages + 1) */
  int *entry;          /* (nz) entries by stage */
  int *row, *column;   /* (nz) their positions, row >= column */
  int *first_boundary; /* (stages + 1) */
  int *boundary;       /* positions of later stages that a stage's front holds, ascending */
} Plan;

static int plan_integers(const Plan *plan) {
  return handed_size(plan->n, plan->stages, plan->chains) + plan->n + 3 * plan->nz + 2 * (plan->stages + 1);
}

static int ascending(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* A plan that knows the order alone, which lies in `handed_over` as `staged_ldl_order` lays it out. */
static Plan bare_plan(int n, int nz, int stages, int chains, const int *handed_over) {
  const int *first = handed_over + n, *pairs = first + stages + 1;
  return (Plan){n, nz, stages, chains, handed_over, first, pairs, pairs + stages, 0, 0, 0, 0, 0, 0, 0};
}

/* Set the plan's arrays out in `room`; the order comes first and the boundaries last. */
static void lay_out(Plan *plan, int *room) {
  const int n = plan->n, nz = plan->nz, stages = plan->stages;
  *plan = bare_plan(n, nz, stages, plan->chains, room);
  room += handed_size(n, stages, plan->chains);
  plan->position = room, room += n;
  plan->first_entry = room, room += stages + 1;
  plan->first_boundary = room, room += stages + 1;
  plan->entry = room, room += nz;
  plan->row = room, room += nz;
  plan->column = room, room += nz;
  plan->boundary = room;
}

static int chain_end(const Plan *plan, int chain) {
  return chain + 1 < plan->chains ? plan->chain[chain + 1] : plan->stages;
}

static int trunk_stage(const Plan *plan) { return plan->chain[plan->chains - 1]; }

/* Position at which the trunk's unknowns begin. */
static int trunk_position(const Plan *plan) { return plan->first[trunk_stage(plan)]; }

/* Boundaries as they are found: `seen` says for each position which stage's has it. */
typedef struct {
  int total, space, *seen;
} Found;

static void add_to_boundary(Plan *plan, Found *found, int stage, int position) {
  if (position < plan->first[stage + 1] || found->seen[position] == stage) return;
  found->seen[position] = stage;
  if (found->total < found->space) plan->boundary[found->total] = position;
  found->total++;
}

static void inherit_boundary(Plan *plan, Found *found, int stage, int from) {
  for (int k = plan->first_boundary[from]; k < plan->first_boundary[from + 1] && k < found->space; k++)
    add_to_boundary(plan, found, stage, plan->boundary[k]);
}

/* Complete a bare plan in `room`, which has `room_size` integers; returns the total length of the boundaries, all of
 * which are there only if they fit. The order is copied, `scratch` has room for 2n. */
static int make_plan(Plan *plan, const int *irn, const int *icn, int *room, int room_size, int *scratch) {
  const int n = plan->n, nz = plan->nz, stages = plan->stages;
  const int space = room_size - plan_integers(plan);
  memcpy(room, plan->order, sizeof(int) * (size_t)handed_size(n, stages, plan->chains));
  lay_out(plan, room);

  int *stage_of = scratch, *seen = scratch + n; /* by position */
  for (int p = 0; p < n; p++) plan->position[plan->order[p]] = p;
  for (int s = 0; s < stages; s++)
    for (int p = plan->first[s]; p < plan->first[s + 1]; p++) stage_of[p] = s;

  /* Entries sorted by the stage that eliminates the earlier of their two positions. */
  int *count = plan->first_entry;
  memset(count, 0, sizeof(int) * (size_t)(stages + 1));
  for (int e = 0; e < nz; e++) {
    const int p = plan->position[irn[e] - 1], q = plan->position[icn[e] - 1];
    count[stage_of[p < q ? p : q] + 1]++;
  }
  for (int s = 0; s < stages; s++) count[s + 1] += count[s];
  for (int e = 0; e < nz; e++) {
    const int p = plan->position[irn[e] - 1], q = plan->position[icn[e] - 1];
    const int low = p < q ? p : q, high = p < q ? q : p;
    const int place = count[stage_of[low]]++;
    plan->entry[place] = e;
    plan->row[place] = high;
    plan->column[place] = low;
  }
  for (int s = stages; s > 0; s--) count[s] = count[s - 1];
  count[0] = 0;

  /* A front reaches as far as its entries do, and as the front before it did. */
  Found found = {0, space, seen};
  for (int p = 0; p < n; p++) seen[p] = -1;
  plan->first_boundary[0] = 0;
  int chain = 0;
  for (int s = 0; s < stages; s++) {
    const int begin = found.total;
    while (chain + 1 < plan->chains && plan->chain[chain + 1] <= s) chain++;
    for (int e = plan->first_entry[s]; e < plan->first_entry[s + 1]; e++)
      add_to_boundary(plan, &found, s, plan->row[e]);
    if (s > plan->chain[chain])
      inherit_boundary(plan, &found, s, s - 1);
    else if (chain == plan->chains - 1)
      for (int c = 0; c < chain; c++) inherit_boundary(plan, &found, s, chain_end(plan, c) - 1);
    if (found.total <= space)
      qsort(plan->boundary + begin, (size_t)(found.total - begin), sizeof(int), ascending);
    plan->first_boundary[s + 1] = found.total;
  }
  return found.total;
}

/* ---- dense pieces ---- */

static int padded(int rows) { return (rows + LANES - 1) / LANES * LANES; }

/* Columns of a front are this far apart: room for a tile that reaches below the last row. */
static int column_stride(int size) { return padded(size) + TILE_ROWS; }

static double largest(const double *x, int n) {
  double most = 0;
#pragma omp simd reduction(max : most)
  for (int i = 0; i < n; i++) {
    const double size = fabs(x[i]);
    most = size > most ? size : most;
  }
  return most;
}

static void subtract(double *restrict y, double factor, const double *restrict x, int n) {
#pragma omp simd
  for (int i = 0; i < n; i++) y[i] -= factor * x[i];
}

static void subtract_two(double *restrict y, double f, const double *restrict u, double g, const double *restrict v,
                         int n) {
#pragma omp simd
  for (int i = 0; i < n; i++) y[i] -= f * u[i] + g * v[i];
}

static double dot(const double *restrict x, const double *restrict y, int n) {
  double sum = 0;
#pragma omp simd reduction(+ : sum)
  for (int i = 0; i < n; i++) sum += x[i] * y[i];
  return sum;
}

/* C -= L W' on the lower triangle of C (m x m); L is (m x k) by columns, W comes in packs of TILE_COLUMNS rows.
 *
 * Tiles reach above the diagonal and below the last row, where a front keeps room. */
static void subtract_product(int m, int k, const double *restrict L, int ldl, const double *restrict W,
                             double *restrict C, int ldc) {
  for (int j = 0; j < m; j += TILE_COLUMNS) {
    const double *pack = W + (size_t)j * (size_t)k;
    for (int i = j; i < m; i += TILE_ROWS) {
      vector sum[TILE_COLUMNS][3] = {0};
      const double *l = L + i;
      for (int p = 0; p < k; p++, l += ldl) {
        const vector l0 = *(const vector *)l, l1 = *(const vector *)(l + LANES), l2 = *(const vector *)(l + 2 * LANES);
        for (int c = 0; c < TILE_COLUMNS; c++) {
          const double w = pack[p * TILE_COLUMNS + c];
          sum[c][0] += l0 * w;
          sum[c][1] += l1 * w;
          sum[c][2] += l2 * w;
        }
      }
      for (int c = 0; c < TILE_COLUMNS; c++) {
        double *out = C + (size_t)(j + c) * (size_t)ldc + i;
        for (int v = 0; v < 3; v++) *(vector *)(out + v * LANES) -= sum[c][v];
      }
    }
  }
}

/* ---- factors of one stage, as they lie in the caller's arrays ----
 *
 * Integers: STAGE_HEADER numbers; for each pair where its record begins among the stage's integers and reals; the
 * pairs' records; the places of the dense rows; 1 or 2 for each column, the size of its pivot.
 * Reals: the pairs' records; D inverse, 2 numbers a column; the panel of L, its columns `padded(rows)` apart.
 * A pair's record: the number of rows and their places; the inverse of the pivot (3 numbers), columns b and a.
 *
 * "Place" is where a solve keeps an unknown. Every chain has places for the trunk's unknowns behind its own, to gather
 * what it takes from them, so that no chain waits for another. */

enum { PAIRS, ROWS, COLUMNS, FIRST, PLACES, DIAGONAL, STAGE_HEADER }; /* the last two: where they begin */

/* Place of the first of a chain's own unknowns, and of the trunk's first one behind them. */
static int own_places(const Plan *plan, int chain) {
  return plan->first[plan->chain[chain]] + chain * (plan->n - trunk_position(plan));
}

static int trunk_places(const Plan *plan, int chain) {
  const int trunk = trunk_position(plan);
  return (chain + 1 < plan->chains ? plan->first[chain_end(plan, chain)] : trunk) + chain * (plan->n - trunk);
}

/* How many places there are. */
static int all_places(const Plan *plan) {
  return plan->n + (plan->chains - 1) * (plan->n - trunk_position(plan));
}

typedef struct {
  int size;       /* unknowns in the front */
  int candidates; /* slots below this may be eliminated here */
  int stride;
  double *a;     /* the front */
  int *position; /* of each slot */
} Front;

typedef struct {
  int *integers; /* next free */
  double *reals;
  int negative; /* eigenvalues so far */
  const Plan *plan;
  int chain, trunk, own_shift, trunk_shift; /* which chain's; places less positions */
} Factors;

static int place_of(const Factors *out, int position) {
  if (position >= out->trunk) return position + out->trunk_shift;
  if (out->chain < out->plan->chains - 1) return position + out->own_shift;
  int chain = 0; /* a chain's unknown that was delayed to the trunk */
  while (out->plan->first[chain_end(out->plan, chain)] <= position) chain++;
  return position + own_places(out->plan, chain) - out->plan->first[out->plan->chain[chain]];
}

static int negative_of_two(double a, double b, double det) { return det < 0 ? 1 : (a + b < 0 ? 2 : 0); }

/* Eliminate the pair in slots k, k+1; 0 when its pivot is not acceptable.
 *
 * With b and a the columns below the pivot, the rest loses [b a] [S g; g c]^-1 [b a]'. Both columns are sparse: only
 * their nonzeros are visited, and kept. */
static int eliminate_pair(Front *front, int k, Factors *out, int *slots) {
  const int stride = front->stride, size = front->size;
  double *b = front->a + (size_t)k * (size_t)stride, *a = b + stride;
  const double S = b[k], g = b[k + 1], c = a[k + 1];
  const double det = S * c - g * g;
  if (fabs(det) < 0.5 * g * g || largest(a + k + 2, size - k - 2) > PAIR_GROWTH * fabs(g) || fabs(g) <= ZERO) return 0;
  out->negative += negative_of_two(S, c, det);

  int count = 0;
  for (int i = k + 2; i < size; i++) {
    slots[count] = i;
    count += (a[i] != 0) | (b[i] != 0);
  }
  int *where = out->integers;
  double *kept = out->reals;
  *where++ = count;
  const double p = c / det, q = -g / det, r = S / det; /* inverse of the pivot: [p q; q r] */
  *kept++ = p, *kept++ = q, *kept++ = r;
  double *kept_b = kept, *kept_a = kept + count;
  int *short_list = slots + count, short_count = 0; /* rows with a nonzero in a, few */
  for (int t = 0; t < count; t++) {
    where[t] = place_of(out, front->position[slots[t]]);
    kept_b[t] = b[slots[t]];
    kept_a[t] = a[slots[t]];
    short_list[short_count] = t;
    short_count += kept_a[t] != 0;
  }
  int below = 0; /* the short list from here on lies on or below the diagonal */
  for (int t = 0; t < count; t++) {
    const double z_b = p * kept_b[t] + q * kept_a[t], z_a = q * kept_b[t] + r * kept_a[t];
    double *column = front->a + (size_t)slots[t] * (size_t)stride;
    if (z_b != 0)
      for (int u = t; u < count; u++) column[slots[u]] -= kept_b[u] * z_b + kept_a[u] * z_a;
    else
      for (int u = below; u < short_count; u++) column[slots[short_list[u]]] -= kept_a[short_list[u]] * z_a;
    below += below < short_count && short_list[below] == t;
  }
  out->integers += 1 + count;
  out->reals += 3 + 2 * count;
  return 1;
}

/* Exchange two candidates, low < high, from column `left` on. */
static void exchange(Front *front, int left, int low, int high) {
  if (low == high) return;
  const int stride = front->stride;
  double *A = front->a;
#define AT(i, j) A[(size_t)(j) * (size_t)stride + (size_t)(i)]
#define SWAP(x, y) do { const double kept = x; x = y; y = kept; } while (0)
  for (int j = left; j < low; j++) SWAP(AT(low, j), AT(high, j));
  SWAP(AT(low, low), AT(high, high));
  for (int i = low + 1; i < high; i++) SWAP(AT(i, low), AT(high, i));
  for (int i = high + 1; i < front->size; i++) SWAP(AT(i, low), AT(i, high));
  const int position = front->position[low];
  front->position[low] = front->position[high];
  front->position[high] = position;
}

/* Column j of the symmetric front without its diagonal, over slots >= k, written out densely; its largest entry, and
 * the slot of its largest entry among the candidates. */
static double column_of(const Front *front, int k, int j, double *full, int *partner) {
  const double *A = front->a;
  const int stride = front->stride;
  double most = -1;
  *partner = -1;
  for (int i = k; i < j; i++) full[i] = AT(j, i);
  full[j] = 0;
  const int below = front->size - j - 1;
  if (below > 0) memcpy(full + j + 1, A + (size_t)j * (size_t)stride + j + 1, sizeof(double) * (size_t)below);
  for (int i = k; i < front->candidates; i++)
    if (i != j && fabs(full[i]) > most) most = fabs(full[i]), *partner = i;
  return largest(full + k, front->size - k);
}

/* Eliminate candidates k, k+1, ... while acceptable pivots are found; returns the slot where it stopped.
 *
 * A pivot is accepted when no entry of L exceeds 1/threshold. `diagonal` (2 a column) and `kinds` receive D inverse. */
static int eliminate_candidates(Front *front, int left, double threshold, int last, double *diagonal, int *kinds,
                                double *work, int *negative) {
  double *A = front->a;
  const int stride = front->stride, size = front->size, limit = front->candidates;
  double *column_j = work, *column_t = work + size;
  int k = left;
  while (k < limit) {
    int found = 0, j, t = -1;
    double u = threshold;
    for (int round = 0; round < (last ? 3 : 1) && !found; round++, u = round == 1 ? 1e-8 : 0)
      for (j = k; j < limit; j++) {
        const double d = AT(j, j);
        const double most_j = column_of(front, k, j, column_j, &t);
        if (fabs(d) > ZERO && fabs(d) >= u * most_j) {
          found = 1;
          break;
        }
        if (t < 0) continue;
        /* 2x2 with the largest candidate of the column: |P^-1| times the columns' largest entries must stay small. */
        int unused;
        const double e = AT(t, t), o = column_j[t];
        column_of(front, k, t, column_t, &unused);
        column_j[t] = column_t[j] = 0;
        const double det = d * e - o * o, size_of = fabs(det);
        const double rest_j = largest(column_j + k, size - k), rest_t = largest(column_t + k, size - k);
        if (size_of <= ZERO * fabs(o)) continue;
        if (u * (fabs(e) * rest_j + fabs(o) * rest_t) <= size_of &&
            u * (fabs(o) * rest_j + fabs(d) * rest_t) <= size_of) {
          found = 2;
          break;
        }
      }
    if (!found) break;

    if (found == 1) {
      exchange(front, left, k, j);
      double *l = A + (size_t)k * (size_t)stride;
      const double d = l[k], inverse = 1 / d;
      *negative += d < 0;
      kinds[k - left] = 1;
      diagonal[2 * (k - left)] = inverse, diagonal[2 * (k - left) + 1] = 0;
      for (int c = k + 1; c < limit; c++) {
        const double factor = l[c] * inverse;
        if (factor != 0) subtract(A + (size_t)c * (size_t)stride + c, factor, l + c, size - c);
      }
      for (int i = k + 1; i < size; i++) l[i] *= inverse;
      l[k] = 1;
      k += 1;
    } else {
      const int low = j < t ? j : t, high = j < t ? t : j;
      exchange(front, left, k, low);
      exchange(front, left, k + 1, high);
      double *l = A + (size_t)k * (size_t)stride, *m = l + stride;
      const double d = l[k], o = l[k + 1], e = m[k + 1], det = d * e - o * o;
      const double p = e / det, q = -o / det, r = d / det;
      *negative += negative_of_two(d, e, det);
      kinds[k - left] = 2, kinds[k - left + 1] = 2;
      diagonal[2 * (k - left)] = p, diagonal[2 * (k - left) + 1] = q;
      diagonal[2 * (k - left) + 2] = r, diagonal[2 * (k - left) + 3] = q;
      for (int c = k + 2; c < limit; c++) {
        const double f = p * l[c] + q * m[c], g = q * l[c] + r * m[c];
        if (f != 0 || g != 0) subtract_two(A + (size_t)c * (size_t)stride + c, f, l + c, g, m + c, size - c);
      }
      for (int i = k + 2; i < size; i++) {
        const double x = l[i], y = m[i];
        l[i] = p * x + q * y;
        m[i] = q * x + r * y;
      }
      l[k] = 1, l[k + 1] = 0, m[k + 1] = 1;
      k += 2;
    }
  }
  return k;
}

/* Boundary -= L D L' of the columns left..end. */
static void update_boundary(Front *front, int left, int end, const double *diagonal, const int *kinds, double *pack) {
  const int stride = front->stride, first = front->candidates, m = front->size - first, k = end - left;
  if (m <= 0 || k <= 0) return;
  const double *L = front->a + (size_t)left * (size_t)stride + first;
  /* W = L D, where 2x2 blocks of D are rebuilt from their inverse. */
  for (int p = 0; p < k; p++) {
    const double *l = L + (size_t)p * (size_t)stride;
    if (kinds[p] == 1) {
      const double d = 1 / diagonal[2 * p];
      for (int j = 0; j < m; j++) pack[((size_t)(j / TILE_COLUMNS) * (size_t)k + (size_t)p) * TILE_COLUMNS + (size_t)(j % TILE_COLUMNS)] = d * l[j];
    } else {
      const double *h = l + stride;
      const double x = diagonal[2 * p], q = diagonal[2 * p + 1], y = diagonal[2 * p + 2], det = x * y - q * q;
      const double d = y / det, o = -q / det, e = x / det;
      for (int j = 0; j < m; j++) {
        double *w = pack + ((size_t)(j / TILE_COLUMNS) * (size_t)k + (size_t)p) * TILE_COLUMNS + (size_t)(j % TILE_COLUMNS);
        w[0] = d * l[j] + o * h[j];
        w[TILE_COLUMNS] = o * l[j] + e * h[j];
      }
      p++;
    }
  }
  for (int p = 0; p < k && m % TILE_COLUMNS; p++)
    for (int j = m; j % TILE_COLUMNS; j++) pack[((size_t)(j / TILE_COLUMNS) * (size_t)k + (size_t)p) * TILE_COLUMNS + (size_t)(j % TILE_COLUMNS)] = 0;
  subtract_product(m, k, L, stride, pack, front->a + (size_t)first * (size_t)stride + first, stride);
}

/* Add what the front before left behind: its slots from `begin` on. `slot` gives the new front's slot by position. */
static void add_remainder(Front *front, const Front *before, int begin, const int *slot) {
  int tail = before->size; /* from here on the new slots follow one another */
  while (tail > begin + 1 && slot[before->position[tail - 2]] + 1 == slot[before->position[tail - 1]]) tail--;
  if (tail > begin) tail--;
  for (int j = begin; j < before->size; j++) {
    const double *from = before->a + (size_t)j * (size_t)before->stride;
    const int c = slot[before->position[j]];
    int i = j;
    for (; i < tail; i++) {
      const int r = slot[before->position[i]];
      const int low = r < c ? r : c, high = r < c ? c : r;
      front->a[(size_t)low * (size_t)front->stride + (size_t)high] += from[i];
    }
    if (i >= before->size) continue;
    const int r = slot[before->position[i]];
    if (r >= c) {
      double *to = front->a + (size_t)c * (size_t)front->stride + r;
      for (int t = i; t < before->size; t++) to[t - i] += from[t];
    } else
      for (int t = i; t < before->size; t++) {
        const int row = slot[before->position[t]];
        const int low = row < c ? row : c, high = row < c ? c : row;
        front->a[(size_t)low * (size_t)front->stride + (size_t)high] += from[t];
      }
  }
}

/* ---- the whole ---- */

/* Integers of the factors' header: what the solve must know. The table follows: where each stage's factors lie. */
enum { STAGE_COUNT, CHAIN_COUNT, THREADS, TABLE, FRONT, HEADER };

/* Room in the fronts for candidates that are delayed; doubled as long as the caller's arrays allow. */
static const int DELAYED_ROOM = 48;

static int factor_reals(int pairs, int candidates, int size) {
  return pairs * (3 + 2 * size) + candidates * (2 + padded(size));
}

static int factor_integers(int pairs, int candidates, int size) {
  return STAGE_HEADER + pairs * (3 + size) + size + candidates;
}

static int front_reals(int size) { return column_stride(size) * (size + TILE_COLUMNS) + TILE_ROWS; }

static int work_reals(int size) { return (size + TILE_COLUMNS) * (size + 2); }

/* What a chain leaves for the trunk: its size, how many of its unknowns were delayed, their positions; the columns. */
enum { SIZE, CANDIDATES, REMAINDER_HEADER };

static int remainder_integers(int size) { return REMAINDER_HEADER + size; }

static int remainder_reals(int size) { return size * size; }

typedef struct {
  int integers, reals;
  int front;     /* size of the largest front */
  int remainder; /* size of the largest remainder */
  int threads;
} Space;

static int thread_reals(const Space *space) { return 2 * front_reals(space->front) + work_reals(space->front); }

static int thread_integers(const Plan *plan, const Space *space) { return plan->n + 4 * space->front; }

/* Space that the factors of a stage may take, with `room` for delayed candidates. */
static Space stage_space(const Plan *plan, int s, int room) {
  const int own = plan->first[s + 1] - plan->first[s], pairs = plan->pairs[s];
  const int boundary = plan->first_boundary[s + 1] - plan->first_boundary[s];
  const int size = own + boundary + room, candidates = own - 2 * pairs + room;
  return (Space){factor_integers(pairs, candidates, size), factor_reals(pairs, candidates, size), size,
                 boundary + room, 0};
}

/* Space that the factorisation takes in all, with `room` for delayed candidates in every front. */
static Space space_for(const Plan *plan, int boundaries, int room, int threads) {
  Space space = {0, 0, 0, 0, threads < plan->chains ? threads : plan->chains};
  for (int s = 0; s < plan->stages; s++) {
    const Space stage = stage_space(plan, s, room);
    space.integers += stage.integers, space.reals += stage.reals;
    if (stage.front > space.front) space.front = stage.front;
  }
  for (int c = 0; c < plan->chains - 1; c++) {
    const Space end = stage_space(plan, chain_end(plan, c) - 1, room);
    if (end.remainder > space.remainder) space.remainder = end.remainder;
  }
  space.reals += plan->nz + space.threads * thread_reals(&space);
  space.reals += (plan->chains - 1) * remainder_reals(space.remainder);
  space.integers += HEADER + plan_integers(plan) + boundaries; /* the plan */
  space.integers += space.threads * thread_integers(plan, &space) + 2 * plan->stages;     /* work, table */
  space.integers += (plan->chains - 1) * remainder_integers(space.remainder);
  return space;
}

/* What a front leaves behind: its slots from `begin` on. */
typedef struct {
  Front front;
  int begin;
} Remainder;

/* Assemble a front: its positions, the entries of the matrix, and `count` remainders. */
static void assemble(Front *front, const Plan *plan, int s, const double *values, const Remainder *left, int count,
                     int *slot) {
  const int first = plan->first[s], next = plan->first[s + 1], paired = first + 2 * plan->pairs[s];
  int size = 0;
  for (int p = first; p < paired; p++) front->position[size++] = p;
  for (int r = 0; r < count; r++)
    for (int d = left[r].begin; d < left[r].front.candidates; d++)
      front->position[size++] = left[r].front.position[d];
  for (int p = paired; p < next; p++) front->position[size++] = p;
  front->candidates = size;
  for (int b = plan->first_boundary[s]; b < plan->first_boundary[s + 1]; b++)
    front->position[size++] = plan->boundary[b];
  front->size = size;
  front->stride = column_stride(size);
  for (int i = 0; i < size; i++) slot[front->position[i]] = i;

  for (int j = 0; j < size; j++)
    memset(front->a + (size_t)j * (size_t)front->stride + j, 0, sizeof(double) * (size_t)(front->stride - j));
  for (int e = plan->first_entry[s]; e < plan->first_entry[s + 1]; e++)
    front->a[(size_t)slot[plan->column[e]] * (size_t)front->stride + (size_t)slot[plan->row[e]]] +=
        values[plan->entry[e]];
  for (int r = 0; r < count; r++) add_remainder(front, &left[r].front, left[r].begin, slot);
}

/* Eliminate what can be eliminated of a front and keep the factors; returns the slot at which the remainder begins. */
static int eliminate(Front *front, int first, int pairs, double threshold, int last, Factors *out, double *work,
                     int *slots) {
  int *integers = out->integers, *table = integers + STAGE_HEADER;
  const double *reals = out->reals;
  out->integers = table + 2 * pairs;
  int left = 0;
  for (; left < 2 * pairs; left += 2) {
    table[left] = (int)(out->integers - integers), table[left + 1] = (int)(out->reals - reals);
    if (!eliminate_pair(front, left, out, slots)) break; /* from here on they are candidates like the others */
  }
  const int rows = front->size - left, stride = padded(rows);
  double *diagonal = out->reals;
  int *places = out->integers, *kinds = places + rows;
  const int end = eliminate_candidates(front, left, threshold, last, diagonal, kinds, work, &out->negative);
  update_boundary(front, left, end, diagonal, kinds, work);

  const int columns = end - left;
  integers[PAIRS] = left / 2, integers[ROWS] = rows, integers[COLUMNS] = columns, integers[FIRST] = place_of(out, first);
  integers[PLACES] = (int)(places - integers), integers[DIAGONAL] = (int)(diagonal - reals);
  for (int i = 0; i < rows; i++) places[i] = place_of(out, front->position[left + i]);
  double *panel = diagonal + 2 * columns;
  for (int p = 0; p < columns; p++)
    memcpy(panel + (size_t)p * (size_t)stride + p,
           front->a + (size_t)(left + p) * (size_t)front->stride + left + p, sizeof(double) * (size_t)(rows - p));
  out->integers = kinds + columns;
  out->reals = panel + (size_t)columns * (size_t)stride;
  return end;
}

/* A factorisation under way: what its threads share. */
typedef struct {
  const Plan *plan;
  Space space;
  int room;
  double threshold, *a;
  int *iw, *table;
  double *thread_reals, *remainder_reals;
  int *thread_integers, *remainder_integers;
  atomic_int negative, crowded, singular;
} Factorisation;

static Remainder kept_remainder(const Factorisation *f, int chain) {
  int *integers = f->remainder_integers + (size_t)chain * (size_t)remainder_integers(f->space.remainder);
  double *reals = f->remainder_reals + (size_t)chain * (size_t)remainder_reals(f->space.remainder);
  return (Remainder){{integers[SIZE], integers[CANDIDATES], integers[SIZE], reals, integers + REMAINDER_HEADER}, 0};
}

static void keep_remainder(const Factorisation *f, int chain, const Remainder *left) {
  int *integers = f->remainder_integers + (size_t)chain * (size_t)remainder_integers(f->space.remainder);
  const int begin = left->begin, size = left->front.size - begin;
  integers[SIZE] = size, integers[CANDIDATES] = left->front.candidates - begin;
  memcpy(integers + REMAINDER_HEADER, left->front.position + begin, sizeof(int) * (size_t)size);
  const Remainder kept = kept_remainder(f, chain);
  for (int j = 0; j < size; j++)
    memcpy(kept.front.a + (size_t)j * (size_t)size + j,
           left->front.a + (size_t)(begin + j) * (size_t)left->front.stride + begin + j,
           sizeof(double) * (size_t)(size - j));
}

/* Eliminate the stages of a chain, its first one with `count` remainders `left` by others. */
static void eliminate_chain(Factorisation *f, int chain, int thread, const Remainder *left, int count) {
  const Plan *plan = f->plan;
  const int front_size = f->space.front, is_trunk = chain == plan->chains - 1;
  double *fronts = f->thread_reals + (size_t)thread * (size_t)thread_reals(&f->space);
  double *work = fronts + 2 * front_reals(front_size);
  int *slot = f->thread_integers + (size_t)thread * (size_t)thread_integers(plan, &f->space);
  int *lists = slot + plan->n, *slots = lists + 2 * front_size;
  const int trunk = trunk_position(plan), first = plan->chain[chain], end = chain_end(plan, chain);
  Factors out = {f->iw + f->table[2 * first], f->a + f->table[2 * first + 1], 0, plan, chain, trunk,
                 own_places(plan, chain) - plan->first[first], trunk_places(plan, chain) - trunk};

  Remainder before;
  for (int s = first; s < end; s++) {
    int delayed = 0;
    for (int r = 0; r < count; r++) delayed += left[r].front.candidates - left[r].begin;
    if (delayed > f->room) {
      f->crowded = 1;
      return;
    }
    Front front = {0, 0, 0, fronts + (s % 2) * front_reals(front_size), lists + (s % 2) * front_size};
    assemble(&front, plan, s, f->a, left, count, slot);
    f->table[2 * s] = (int)(out.integers - f->iw), f->table[2 * s + 1] = (int)(out.reals - f->a);
    const int last = is_trunk && s == end - 1;
    const int begin = eliminate(&front, plan->first[s], plan->pairs[s], f->threshold, last, &out, work, slots);
    if (last && begin < front.candidates) f->singular = 1;
    before = (Remainder){front, begin}, left = &before, count = 1;
  }
  f->negative += out.negative;
  if (!is_trunk) keep_remainder(f, chain, left);
}

static void eliminate_branch(void *context, int chain, int thread) { eliminate_chain(context, chain, thread, NULL, 0); }

/* Factorise the matrix whose entries `a` begins with. Returns 0 or one of the failures; `*needed` is the space that
 * the ones for want of space ask for. */
static int factorise(const Plan *plan, int boundaries, double threshold, int threads, double *a, int real_space,
                     int *iw, int integer_space, int *negative, int *needed) {
  int room = DELAYED_ROOM;
  Space space = space_for(plan, boundaries, room, threads);
  for (;;) {
    const Space more = space_for(plan, boundaries, 2 * room, threads);
    if (more.reals > real_space || more.integers > integer_space) break;
    space = more, room *= 2;
  }
  if (space.reals > real_space) return *needed = space.reals, NO_REAL_SPACE;
  if (space.integers > integer_space) return *needed = space.integers, NO_INTEGER_SPACE;

  const int branches = plan->chains - 1;
  Factorisation f = {.plan = plan, .space = space, .room = room, .threshold = threshold, .a = a, .iw = iw};
  f.thread_reals = a + plan->nz;
  f.remainder_reals = f.thread_reals + (size_t)space.threads * (size_t)thread_reals(&space);
  f.thread_integers = iw + HEADER + plan_integers(plan) + boundaries;
  f.remainder_integers = f.thread_integers + (size_t)space.threads * (size_t)thread_integers(plan, &space);
  f.table = f.remainder_integers + (size_t)branches * (size_t)remainder_integers(space.remainder);
  iw[STAGE_COUNT] = plan->stages, iw[CHAIN_COUNT] = plan->chains, iw[THREADS] = threads;
  iw[TABLE] = (int)(f.table - iw), iw[FRONT] = space.front;
  /* Every chain's factors have their room from the start. */
  int integers = iw[TABLE] + 2 * plan->stages;
  int reals = (int)(f.remainder_reals - a) + branches * remainder_reals(space.remainder);
  for (int s = 0; s < plan->stages; s++) {
    const Space stage = stage_space(plan, s, room);
    f.table[2 * s] = integers, f.table[2 * s + 1] = reals;
    integers += stage.integers, reals += stage.reals;
  }

  Remainder *left = malloc(sizeof(Remainder) * (size_t)plan->chains);
  if (!left) return SINGULAR;
  for_each(branches, space.threads, eliminate_branch, &f);
  for (int c = 0; c < branches && !f.crowded; c++) left[c] = kept_remainder(&f, c);
  if (!f.crowded) eliminate_chain(&f, branches, 0, left, branches);
  free(left);
  *negative = f.negative;
  if (f.crowded) return *needed = space_for(plan, boundaries, 2 * room, threads).reals, NO_REAL_SPACE;
  return f.singular ? SINGULAR : 0;
}

/* A solve under way: x by place, and for each thread a `local` of one front. */
typedef struct {
  const Plan *plan;
  const int *iw;
  const double *a, *rhs;
  double *x, *local;
} Solve;

/* Forward through the stages of a chain: x loses what the eliminated unknowns carry. */
static void solve_forward(const Solve *solve, int chain, double *local) {
  const int *iw = solve->iw;
  double *x = solve->x;
  for (int s = solve->plan->chain[chain]; s < chain_end(solve->plan, chain); s++) {
    const int *integers = iw + iw[iw[TABLE] + 2 * s], *table = integers + STAGE_HEADER;
    const double *reals = solve->a + iw[iw[TABLE] + 2 * s + 1];
    const int rows = integers[ROWS], columns = integers[COLUMNS], stride = padded(rows);
    const int *places = integers + integers[PLACES];
    const double *panel = reals + integers[DIAGONAL] + 2 * columns;
    for (int k = 0; k < integers[PAIRS]; k++) {
      const int *record = integers + table[2 * k], count = record[0], *where = record + 1;
      const double *pivot = reals + table[2 * k + 1], *b = pivot + 3, *c = b + count;
      const double *y = x + integers[FIRST] + 2 * k;
      const double u = pivot[0] * y[0] + pivot[1] * y[1], v = pivot[1] * y[0] + pivot[2] * y[1];
      for (int t = 0; t < count; t++) x[where[t]] -= b[t] * u + c[t] * v;
    }
    for (int i = 0; i < rows; i++) local[i] = x[places[i]];
    for (int p = 0; p < columns; p++, panel += stride) subtract(local + p + 1, local[p], panel + p + 1, rows - p - 1);
    for (int i = 0; i < rows; i++) x[places[i]] = local[i];
  }
}

/* Backward: x becomes the solution. */
static void solve_backward(const Solve *solve, int chain, double *local) {
  const int *iw = solve->iw;
  double *x = solve->x;
  for (int s = chain_end(solve->plan, chain) - 1; s >= solve->plan->chain[chain]; s--) {
    const int *integers = iw + iw[iw[TABLE] + 2 * s], *table = integers + STAGE_HEADER;
    const double *reals = solve->a + iw[iw[TABLE] + 2 * s + 1];
    const int pairs = integers[PAIRS], rows = integers[ROWS], columns = integers[COLUMNS], stride = padded(rows);
    const int *places = integers + integers[PLACES];
    const double *diagonal = reals + integers[DIAGONAL];
    const int *kinds = places + rows;
    const double *panel = diagonal + 2 * columns;
    for (int i = 0; i < rows; i++) local[i] = x[places[i]];
    for (int p = 0; p < columns; p++) {
      if (kinds[p] == 1) {
        local[p] *= diagonal[2 * p];
        continue;
      }
      const double u = local[p], v = local[p + 1];
      local[p] = diagonal[2 * p] * u + diagonal[2 * p + 1] * v;
      local[p + 1] = diagonal[2 * p + 1] * u + diagonal[2 * p + 2] * v;
      p++;
    }
    for (int p = columns - 1; p >= 0; p--)
      local[p] -= dot(local + p + 1, panel + (size_t)p * (size_t)stride + p + 1, rows - p - 1);
    for (int i = 0; i < columns; i++) x[places[i]] = local[i];
    for (int k = pairs - 1; k >= 0; k--) {
      const int *record = integers + table[2 * k], count = record[0], *where = record + 1;
      const double *pivot = reals + table[2 * k + 1], *b = pivot + 3, *c = b + count;
      double *y = x + integers[FIRST] + 2 * k, u = y[0], v = y[1];
      for (int t = 0; t < count; t++) u -= b[t] * x[where[t]], v -= c[t] * x[where[t]];
      y[0] = pivot[0] * u + pivot[1] * v;
      y[1] = pivot[1] * u + pivot[2] * v;
    }
  }
}

static void load(const Solve *solve, int chain) {
  const Plan *plan = solve->plan;
  const int first = plan->first[plan->chain[chain]], end = plan->first[chain_end(plan, chain)];
  double *own = solve->x + own_places(plan, chain);
  for (int p = first; p < end; p++) own[p - first] = solve->rhs[plan->order[p]];
}

static void forward_branch(void *context, int chain, int thread) {
  const Solve *solve = context;
  const int trunk_size = solve->plan->n - trunk_position(solve->plan);
  load(solve, chain);
  memset(solve->x + trunk_places(solve->plan, chain), 0, sizeof(double) * (size_t)trunk_size);
  solve_forward(solve, chain, solve->local + (size_t)thread * (size_t)solve->iw[FRONT]);
}

static void backward_branch(void *context, int chain, int thread) {
  const Solve *solve = context;
  const Plan *plan = solve->plan;
  const int trunk_size = plan->n - trunk_position(plan);
  memcpy(solve->x + trunk_places(plan, chain), solve->x + own_places(plan, plan->chains - 1),
         sizeof(double) * (size_t)trunk_size);
  solve_backward(solve, chain, solve->local + (size_t)thread * (size_t)solve->iw[FRONT]);
}

/* Solve with the factors; `w` has room for x and the threads' fronts. */
static void solve_all(int n, const int *iw, const double *a, double *rhs, double *w) {
  const Plan bare = bare_plan(n, 0, iw[STAGE_COUNT], iw[CHAIN_COUNT], iw + HEADER), *plan = &bare;
  const int threads = iw[THREADS];
  Solve solve = {plan, iw, a, rhs, w, w + all_places(plan)};
  const int branches = plan->chains - 1, trunk = trunk_position(plan);
  double *x = w + own_places(plan, branches);
  for_each(branches, threads, forward_branch, &solve);
  load(&solve, branches);
  for (int c = 0; c < branches; c++) {
    const double *taken = w + trunk_places(plan, c);
    for (int i = 0; i < plan->n - trunk; i++) x[i] += taken[i];
  }
  solve_forward(&solve, branches, solve.local);
  solve_backward(&solve, branches, solve.local);
  for_each(branches, threads, backward_branch, &solve);
  for (int c = 0; c < plan->chains; c++) {
    const int first = plan->first[plan->chain[c]], end = plan->first[chain_end(plan, c)];
    const double *own = w + own_places(plan, c);
    for (int p = first; p < end; p++) rhs[plan->order[p]] = own[p - first];
  }
}

/* ---- the calling sequence of MA27 ----
 *
 * IKEEP (3n integers) carries the order of elimination from the analysis to the factorisations, PLANNED, BOUNDARIES and
 * the counts in front of it. `iw` and `a` are allocated in between, so the plan is made again by the first
 * factorisation and kept in `iw`. */

enum { PLANNED = FRONT + 1, BOUNDARIES, KEPT };

static Plan kept_plan(int n, int nz, const int *ikeep) {
  return bare_plan(n, nz, ikeep[STAGE_COUNT], ikeep[CHAIN_COUNT], ikeep + KEPT);
}

void ma27id_(int *icntl, double *cntl) {
  memset(icntl, 0, 30 * sizeof(int));
  memset(cntl, 0, 5 * sizeof(double));
}

/* Analysis: nothing but the sizes of the arrays that the factorisation needs (INFO(5) reals, INFO(6) integers). */
void ma27ad_(int *n, int *nz, const int *irn, const int *icn, int *iw, int *liw, int *ikeep, int *iw1, int *nsteps,
             int *iflag, int *icntl, double *cntl, int *info, double *ops) {
  (void)iw, (void)liw, (void)iflag, (void)icntl, (void)cntl;
  memset(info, 0, 20 * sizeof(int));
  *nsteps = 1, *ops = 0;
  const int kept = handed_size(*n, handed.stages, handed.chains);
  if (handed.n != *n || KEPT + kept > 3 * *n) {
    handed.refused++;
    info[0] = FAILED_SIZE;
    return;
  }
  ikeep[PLANNED] = 0, ikeep[STAGE_COUNT] = handed.stages, ikeep[CHAIN_COUNT] = handed.chains;
  ikeep[THREADS] = handed.threads;
  memcpy(ikeep + KEPT, handed.order, sizeof(int) * (size_t)kept);
  /* Room for boundaries: every stage may reach all that follows, but rarely does. */
  Plan plan = kept_plan(*n, *nz, ikeep);
  for (int most = 200 * handed.stages;; most *= 2) {
    const int size = plan_integers(&plan) + most;
    int *room = malloc(sizeof(int) * (size_t)size);
    if (!room) {
      info[0] = NO_INTEGER_SPACE;
      return;
    }
    plan = kept_plan(*n, *nz, ikeep);
    ikeep[BOUNDARIES] = make_plan(&plan, irn, icn, room, size, iw1);
    const int fits = ikeep[BOUNDARIES] <= most;
    if (fits) {
      const Space space = space_for(&plan, ikeep[BOUNDARIES], DELAYED_ROOM, handed.threads);
      info[4] = space.reals, info[5] = space.integers;
    }
    free(room);
    if (fits) return;
  }
}

/* Factorisation: INFO(1) as MA27 says it, INFO(15) the number of negative eigenvalues. */
void ma27bd_(int *n, int *nz, const int *irn, const int *icn, double *a, int *la, int *iw, int *liw, int *ikeep,
             int *nsteps, int *maxfrt, int *iw1, int *icntl, double *cntl, int *info) {
  (void)nsteps, (void)icntl;
  memset(info, 0, 20 * sizeof(int));
  Plan plan = kept_plan(*n, *nz, ikeep);
  const int planned = plan_integers(&plan) + ikeep[BOUNDARIES];
  if (HEADER + planned > *liw) {
    info[0] = NO_INTEGER_SPACE, info[1] = 2 * (HEADER + planned);
    return;
  }
  if (ikeep[PLANNED])
    lay_out(&plan, iw + HEADER);
  else
    make_plan(&plan, irn, icn, iw + HEADER, planned, iw1);
  ikeep[PLANNED] = 1;
  info[0] = factorise(&plan, ikeep[BOUNDARIES], cntl[0], ikeep[THREADS], a, *la, iw, *liw, &info[14], &info[1]);
  /* Both arrays are allocated anew then, and the plan is lost with them. */
  if (info[0] == NO_REAL_SPACE || info[0] == NO_INTEGER_SPACE) ikeep[PLANNED] = 0;
  *maxfrt = all_places(&plan) + ikeep[THREADS] * iw[FRONT];
}

void ma27cd_(int *n, double *a, int *la, int *iw, int *liw, double *w, int *maxfrt, double *rhs, int *iw1,
             int *nsteps, int *icntl, double *cntl) {
  (void)la, (void)liw, (void)maxfrt, (void)iw1, (void)nsteps, (void)icntl, (void)cntl;
  solve_all(*n, iw, a, rhs, w);
}
