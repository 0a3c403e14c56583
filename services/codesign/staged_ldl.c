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
 * IPOPT finds this library as `hsllib` and calls it by the names of MA27. Everything between two calls lives in the
 * arrays that the caller owns, so there is nothing to free. The order of elimination is not found here: it is handed
 * over beforehand with `staged_ldl_order` (elimination.py).
 *
 * "Index" is an unknown as the caller counts, "position" its place in the order of elimination, "slot" its place in
 * a front. Fronts are stored by columns, lower triangle only.
 */

#include <float.h>
#include <math.h>
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
  int n, stages;
  int *order; /* (n) index at each position */
  int *first; /* (stages + 1) position at which each stage begins */
  int *pairs; /* (stages) number of pairs at the beginning of each stage: variable, constraint, variable, ... */
  int refused; /* systems of another size that came since */
} handed;

/* Hand over the order for the systems that follow. Returns 0, or 1 when there is no memory. */
int staged_ldl_order(int n, int stages, const int *order, const int *first, const int *pairs) {
  int *room = malloc(sizeof(int) * (size_t)(n + 2 * stages + 1));
  if (!room) return 1;
  free(handed.order);
  handed.n = n;
  handed.stages = stages;
  handed.refused = 0;
  handed.order = room;
  handed.first = room + n;
  handed.pairs = room + n + stages + 1;
  memcpy(handed.order, order, sizeof(int) * (size_t)n);
  memcpy(handed.first, first, sizeof(int) * (size_t)(stages + 1));
  memcpy(handed.pairs, pairs, sizeof(int) * (size_t)stages);
  return 0;
}

/* How many systems came since that the order does not fit. */
int staged_ldl_refused(void) { return handed.refused; }

/* ---- the plan: which entry goes where, found once for a pattern ---- */

typedef struct {
  int n, nz, stages;
  const int *first, *pairs;
  int *order, *position; /* (n) index at each position, and position of each index */
  int *first_entry;    /* (stages + 1) */
  int *entry;          /* (nz) entries by stage */
  int *row, *column;   /* (nz) their positions, row >= column */
  int *first_boundary; /* (stages + 1) */
  int *boundary;       /* positions of later stages that a stage's front holds, ascending */
} Plan;

static int plan_integers(int n, int nz, int stages) { return 2 * n + 3 * nz + 2 * (stages + 1); }

static int ascending(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* Set the plan's arrays out in `room`; the boundaries come last. */
static void lay_out(Plan *plan, int *room) {
  const int n = plan->n, nz = plan->nz, stages = plan->stages;
  plan->order = room, room += n;
  plan->position = room, room += n;
  plan->first_entry = room, room += stages + 1;
  plan->first_boundary = room, room += stages + 1;
  plan->entry = room, room += nz;
  plan->row = room, room += nz;
  plan->column = room, room += nz;
  plan->boundary = room;
}

/* Make the plan in `room`, which has `room_size` integers; returns the total length of the boundaries, all of which
 * are there only if they fit. `order` is copied, `scratch` has room for 2n. */
static int make_plan(Plan *plan, const int *order, const int *irn, const int *icn, int *room, int room_size,
                     int *scratch) {
  const int n = plan->n, nz = plan->nz, stages = plan->stages;
  const int space = room_size - plan_integers(n, nz, stages);
  lay_out(plan, room);
  memcpy(plan->order, order, sizeof(int) * (size_t)n);

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
  int total = 0;
  for (int p = 0; p < n; p++) seen[p] = -1;
  plan->first_boundary[0] = 0;
  for (int s = 0; s < stages; s++) {
    const int begin = total, next = plan->first[s + 1];
    for (int e = plan->first_entry[s]; e < plan->first_entry[s + 1]; e++) {
      const int p = plan->row[e];
      if (p >= next && seen[p] != s) {
        seen[p] = s;
        if (total < space) plan->boundary[total] = p;
        total++;
      }
    }
    if (s > 0)
      for (int k = plan->first_boundary[s - 1]; k < plan->first_boundary[s] && k < space; k++) {
        const int p = plan->boundary[k];
        if (p >= next && seen[p] != s) {
          seen[p] = s;
          if (total < space) plan->boundary[total] = p;
          total++;
        }
      }
    if (total <= space) qsort(plan->boundary + begin, (size_t)(total - begin), sizeof(int), ascending);
    plan->first_boundary[s + 1] = total;
  }
  return total;
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
 * Integers: STAGE_HEADER numbers; for each pair the places of its record among the stage's integers and reals; the
 * pairs' records; the positions of the dense rows; 1 or 2 for each column, the size of its pivot.
 * Reals: the pairs' records; D inverse, 2 numbers a column; the panel of L, its columns `padded(rows)` apart.
 * A pair's record: the number of rows and their positions; the inverse of the pivot (3 numbers), columns b and a. */

enum { PAIRS, ROWS, COLUMNS, FIRST, POSITIONS, DIAGONAL, STAGE_HEADER }; /* the last two: places, as for the pairs */

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
} Factors;

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
    where[t] = front->position[slots[t]];
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
enum { STAGES, TABLE, FRONT, HEADER };

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

typedef struct {
  int integers, reals;
  int front; /* size of the largest front */
} Space;

/* Space that the factorisation takes in all, with `room` for delayed candidates in every front. */
static Space space_for(const Plan *plan, int boundaries, int room) {
  Space space = {0, 0, 0};
  for (int s = 0; s < plan->stages; s++) {
    const int own = plan->first[s + 1] - plan->first[s], pairs = plan->pairs[s];
    const int size = own + plan->first_boundary[s + 1] - plan->first_boundary[s] + room;
    space.reals += factor_reals(pairs, own - 2 * pairs + room, size);
    space.integers += factor_integers(pairs, own - 2 * pairs + room, size);
    if (size > space.front) space.front = size;
  }
  space.reals += plan->nz + 2 * front_reals(space.front) + work_reals(space.front);
  space.integers += HEADER + plan_integers(plan->n, plan->nz, plan->stages) + boundaries; /* the plan */
  space.integers += plan->n + 4 * space.front + 2 * plan->stages;                         /* work, table */
  return space;
}

/* Assemble a front: its positions, the entries of the matrix, what the front before left from slot `begin` on. */
static void assemble(Front *front, const Plan *plan, int s, const double *values, const Front *before, int begin,
                     int *slot) {
  const int first = plan->first[s], next = plan->first[s + 1], paired = first + 2 * plan->pairs[s];
  int size = 0;
  for (int p = first; p < paired; p++) front->position[size++] = p;
  for (int d = begin; d < before->candidates; d++) front->position[size++] = before->position[d];
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
  add_remainder(front, before, begin, slot);
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
  int *positions = out->integers, *kinds = positions + rows;
  const int end = eliminate_candidates(front, left, threshold, last, diagonal, kinds, work, &out->negative);
  update_boundary(front, left, end, diagonal, kinds, work);

  const int columns = end - left;
  integers[PAIRS] = left / 2, integers[ROWS] = rows, integers[COLUMNS] = columns, integers[FIRST] = first;
  integers[POSITIONS] = (int)(positions - integers), integers[DIAGONAL] = (int)(diagonal - reals);
  memcpy(positions, front->position + left, sizeof(int) * (size_t)rows);
  double *panel = diagonal + 2 * columns;
  for (int p = 0; p < columns; p++)
    memcpy(panel + (size_t)p * (size_t)stride + p,
           front->a + (size_t)(left + p) * (size_t)front->stride + left + p, sizeof(double) * (size_t)(rows - p));
  out->integers = kinds + columns;
  out->reals = panel + (size_t)columns * (size_t)stride;
  return end;
}

/* Factorise the matrix whose entries `a` begins with. Returns 0 or one of the failures; `*needed` is the space that
 * the ones for want of space ask for. */
static int factorise(const Plan *plan, int boundaries, double threshold, double *a, int real_space, int *iw,
                     int integer_space, int *negative, int *needed) {
  int room = DELAYED_ROOM;
  Space space = space_for(plan, boundaries, room);
  for (;;) {
    const Space more = space_for(plan, boundaries, 2 * room);
    if (more.reals > real_space || more.integers > integer_space) break;
    space = more, room *= 2;
  }
  if (space.reals > real_space) return *needed = space.reals, NO_REAL_SPACE;
  if (space.integers > integer_space) return *needed = space.integers, NO_INTEGER_SPACE;

  double *fronts = a + plan->nz, *work = fronts + 2 * front_reals(space.front);
  int *slot = iw + HEADER + plan_integers(plan->n, plan->nz, plan->stages) + boundaries;
  int *lists = slot + plan->n, *slots = lists + 2 * space.front, *table = slots + 2 * space.front;
  Factors out = {table + 2 * plan->stages, work + work_reals(space.front), 0};
  iw[STAGES] = plan->stages, iw[TABLE] = (int)(table - iw), iw[FRONT] = space.front;

  Front before = {0, 0, 0, 0, 0};
  int begin = 0;
  for (int s = 0; s < plan->stages; s++) {
    if (before.candidates - begin > room) return *needed = space_for(plan, boundaries, 2 * room).reals, NO_REAL_SPACE;
    Front front = {0, 0, 0, fronts + (s % 2) * front_reals(space.front), lists + (s % 2) * space.front};
    assemble(&front, plan, s, a, &before, begin, slot);
    table[2 * s] = (int)(out.integers - iw), table[2 * s + 1] = (int)(out.reals - a);
    const int last = s == plan->stages - 1;
    begin = eliminate(&front, plan->first[s], plan->pairs[s], threshold, last, &out, work, slots);
    if (last && begin < front.candidates) return SINGULAR;
    before = front;
  }
  *negative = out.negative;
  return 0;
}

/* Forward through the stages: x (by position) loses what the eliminated unknowns carry. `local` holds one front. */
static void solve_forward(const int *iw, const double *a, double *x, double *local) {
  for (int s = 0; s < iw[STAGES]; s++) {
    const int *integers = iw + iw[iw[TABLE] + 2 * s], *table = integers + STAGE_HEADER;
    const double *reals = a + iw[iw[TABLE] + 2 * s + 1];
    const int rows = integers[ROWS], columns = integers[COLUMNS], stride = padded(rows);
    const int *positions = integers + integers[POSITIONS];
    const double *panel = reals + integers[DIAGONAL] + 2 * columns;
    for (int k = 0; k < integers[PAIRS]; k++) {
      const int *record = integers + table[2 * k], count = record[0], *where = record + 1;
      const double *pivot = reals + table[2 * k + 1], *b = pivot + 3, *c = b + count;
      const double *y = x + integers[FIRST] + 2 * k;
      const double u = pivot[0] * y[0] + pivot[1] * y[1], v = pivot[1] * y[0] + pivot[2] * y[1];
      for (int t = 0; t < count; t++) x[where[t]] -= b[t] * u + c[t] * v;
    }
    for (int i = 0; i < rows; i++) local[i] = x[positions[i]];
    for (int p = 0; p < columns; p++, panel += stride) subtract(local + p + 1, local[p], panel + p + 1, rows - p - 1);
    for (int i = 0; i < rows; i++) x[positions[i]] = local[i];
  }
}

/* Backward: x becomes the solution. */
static void solve_backward(const int *iw, const double *a, double *x, double *local) {
  for (int s = iw[STAGES] - 1; s >= 0; s--) {
    const int *integers = iw + iw[iw[TABLE] + 2 * s], *table = integers + STAGE_HEADER;
    const double *reals = a + iw[iw[TABLE] + 2 * s + 1];
    const int pairs = integers[PAIRS], rows = integers[ROWS], columns = integers[COLUMNS], stride = padded(rows);
    const int *positions = integers + integers[POSITIONS];
    const double *diagonal = reals + integers[DIAGONAL];
    const int *kinds = positions + rows;
    const double *panel = diagonal + 2 * columns;
    for (int i = 0; i < rows; i++) local[i] = x[positions[i]];
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
    for (int i = 0; i < columns; i++) x[positions[i]] = local[i];
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

/* ---- the calling sequence of MA27 ----
 *
 * IKEEP (3n integers) carries the order of elimination from the analysis to the factorisations. `iw` and `a` are
 * allocated in between, so the plan is made again by the first factorisation and kept in `iw`. */

enum { PLANNED, BOUNDARIES, STAGE_COUNT, KEPT };

static Plan kept_plan(int n, int nz, const int *ikeep) {
  const int stages = ikeep[STAGE_COUNT], *order = ikeep + KEPT;
  Plan plan = {n, nz, stages, order + n, order + n + stages + 1, 0, 0, 0, 0, 0, 0, 0, 0};
  return plan;
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
  if (handed.n != *n || KEPT + *n + 2 * handed.stages + 1 > 3 * *n) {
    handed.refused++;
    info[0] = FAILED_SIZE;
    return;
  }
  ikeep[PLANNED] = 0, ikeep[STAGE_COUNT] = handed.stages;
  memcpy(ikeep + KEPT, handed.order, sizeof(int) * (size_t)(*n + 2 * handed.stages + 1));
  Plan plan = kept_plan(*n, *nz, ikeep);
  /* Room for boundaries: every stage may reach all that follows, but rarely does. */
  for (int most = 200 * handed.stages;; most *= 2) {
    const int size = plan_integers(*n, *nz, handed.stages) + most;
    int *room = malloc(sizeof(int) * (size_t)size);
    if (!room) {
      info[0] = NO_INTEGER_SPACE;
      return;
    }
    ikeep[BOUNDARIES] = make_plan(&plan, handed.order, irn, icn, room, size, iw1);
    const int fits = ikeep[BOUNDARIES] <= most;
    if (fits) {
      const Space space = space_for(&plan, ikeep[BOUNDARIES], DELAYED_ROOM);
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
  const int planned = plan_integers(*n, *nz, plan.stages) + ikeep[BOUNDARIES];
  if (HEADER + planned > *liw) {
    info[0] = NO_INTEGER_SPACE, info[1] = 2 * (HEADER + planned);
    return;
  }
  if (ikeep[PLANNED])
    lay_out(&plan, iw + HEADER);
  else
    make_plan(&plan, ikeep + KEPT, irn, icn, iw + HEADER, planned, iw1);
  ikeep[PLANNED] = 1;
  info[0] = factorise(&plan, ikeep[BOUNDARIES], cntl[0], a, *la, iw, *liw, &info[14], &info[1]);
  /* Both arrays are allocated anew then, and the plan is lost with them. */
  if (info[0] == NO_REAL_SPACE || info[0] == NO_INTEGER_SPACE) ikeep[PLANNED] = 0;
  *maxfrt = *n + iw[FRONT];
}

void ma27cd_(int *n, double *a, int *la, int *iw, int *liw, double *w, int *maxfrt, double *rhs, int *iw1,
             int *nsteps, int *icntl, double *cntl) {
  (void)la, (void)liw, (void)maxfrt, (void)iw1, (void)nsteps, (void)icntl, (void)cntl;
  const int *order = iw + HEADER; /* the plan begins with it */
  for (int p = 0; p < *n; p++) w[p] = rhs[order[p]];
  solve_forward(iw, a, w, w + *n);
  solve_backward(iw, a, w, w + *n);
  for (int p = 0; p < *n; p++) rhs[order[p]] = w[p];
}
