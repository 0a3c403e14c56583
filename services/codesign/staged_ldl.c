/* Symmetric indefinite factorisation, stage by stage: L D L' of the systems that IPOPT solves at every iteration.
 *
 * The unknowns are eliminated in stages, the intervals of the motion; what a stage leaves behind is a small dense
 * matrix over the unknowns that it shares with later ones (the state at the interval's end, the design and t_f). So
 * every stage is a dense "front": assemble the matrix entries of the stage, add what the stage before left, eliminate
 * the stage's own unknowns, hand on the rest (Duff & Reid 1983, the multifrontal method, on a chain).
 *
 * In a front come first the pairs: a variable and the one sparse constraint that fixes it (a voltage and its motor
 * equation, a slack and its inequality). Their 2x2 pivots [S g; g c] with c = 0 touch few rows, which are known from
 * the pattern. Then the candidates, eliminated with threshold pivoting in 1x1 and 2x2 steps (Duff & Reid 1996,
 * section 2); a candidate without an acceptable pivot is delayed to the next stage. Last the boundary, which belongs
 * to later stages.
 *
 * Stages come in chains. What the stages of a chain leave behind, the last of them hands to the trunk, the last chain;
 * so all chains but the trunk are eliminated side by side, by several threads (the motions of the program of all tasks,
 * with the design in the trunk). The trunk adds up what they left in their order, whichever thread was first: the
 * numbers do not depend on how many threads there are.
 *
 * IPOPT finds this library as `hsllib` and calls it by the names of MA27. Everything between two calls lives in the
 * arrays that the caller owns; only the last plan is kept besides, for systems alike. The order of elimination is not
 * found here: it is handed over beforehand with `staged_ldl_order` (elimination.py).
 *
 * "Index" is an unknown as the caller counts, "position" its place in the order of elimination, "slot" its place in
 * a front. All fronts have the same number of slots, the pairs at their beginning and the boundary at their end:
 *
 *     pairs | room | delayed candidates, candidates | boundary
 *                   `dense`                          `limit`  `size`
 *
 * They are stored by columns, lower triangle only. Loops run in whole vectors beyond the last slot, where every
 * column keeps zeros. */

#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

/* Doubles in a vector: no more than the machine's hold, for the compiler keeps wider ones in memory, six times slower. */
#ifdef __AVX512F__
#define LANES 8
#else
#define LANES 4
#endif
#define TILE_COLUMNS 4
#define TILE_VECTORS 3
#define COLUMN_VECTORS 8

typedef double vector __attribute__((vector_size(8 * LANES), aligned(8)));

/* Largest entry of a pair's constraint row over the entry that the pair is eliminated by. */
static const double PAIR_GROWTH = 1e3;

/* A pivot this small is zero. */
static const double ZERO = 1e-20;

enum { FAILED_SIZE = -1, NO_INTEGER_SPACE = -3, NO_REAL_SPACE = -4, SINGULAR = -5 };

/* ---- the order of elimination, as handed over ---- */

static struct {
  int n, stages, chains;
  int first_multiplier; /* index of the first multiplier of IPOPT's systems; n when they are of another kind */
  int *order; /* (n) index at each position */
  int *first; /* (stages + 1) position at which each stage begins */
  int *pairs; /* (stages) number of pairs at the beginning of each stage: variable, constraint, variable, ... */
  int *chain; /* (chains) stage at which each chain begins; the last chain is the trunk */
  int threads; /* how many eliminate chains */
  int refused; /* systems of another size that came since */
} handed;

static int handed_size(int n, int stages, int chains) { return n + 2 * stages + 1 + chains; }

/* Hand over the order for the systems that follow. Returns 0, or 1 when there is no memory. */
int staged_ldl_order(int n, int stages, int chains, int first_multiplier, const int *order, const int *first,
                     const int *pairs, const int *chain, int threads) {
  int *room = malloc(sizeof(int) * (size_t)handed_size(n, stages, chains));
  if (!room) return 1;
  free(handed.order);
  handed.n = n;
  handed.stages = stages;
  handed.chains = chains;
  handed.first_multiplier = first_multiplier;
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
  int n, nz, stages, chains, first_multiplier;
  const int *order, *first, *pairs, *chain; /* as handed over */
  int size, stride;    /* slots of a front, distance of its columns */
  int *first_entry;    /* (stages + 1) */
  int *entry;       /* (nz) entries by stage */
  int *target;      /* (nz) where each goes in its front */
  int *first_boundary; /* (stages + 1) */
  int *first_list;     /* (stages) where each stage's lists begin */
  int *boundary;       /* positions of later stages that a stage's front holds, ascending; behind them the slots of all
                          these in the front of the stage that they are handed to */
  int *lists;          /* of each pair, see `length_of_list` */
} Plan;

/* A pair's list: how many rows its variable's column and its constraint's column reach; the slots of the ones, and of
 * the others, ascending. */
enum { ROWS_OF_VARIABLE, ROWS_OF_CONSTRAINT, LIST_HEADER };

static int length_of_list(const int *list) { return LIST_HEADER + list[ROWS_OF_VARIABLE] + list[ROWS_OF_CONSTRAINT]; }

/* Integers of a plan but for boundaries and lists. */
static int plan_integers(const Plan *plan) {
  return handed_size(plan->n, plan->stages, plan->chains) + 2 * plan->nz + 3 * plan->stages + 2;
}

static int boundary_of(const Plan *plan, int s) { return plan->first_boundary[s + 1] - plan->first_boundary[s]; }

static int candidates_of(const Plan *plan, int s) {
  return plan->first[s + 1] - plan->first[s] - 2 * plan->pairs[s];
}

static int ascending(const void *a, const void *b) { return *(const int *)a - *(const int *)b; }

/* A plan that knows the order alone, which lies in `handed_over` as `staged_ldl_order` lays it out. */
static Plan bare_plan(int n, int nz, int stages, int chains, const int *handed_over) {
  const int *first = handed_over + n, *pairs = first + stages + 1;
  return (Plan){.n = n, .nz = nz, .stages = stages, .chains = chains,
                .order = handed_over, .first = first, .pairs = pairs, .chain = pairs + stages};
}

/* Set the plan's arrays out in `room`; the order comes first, boundaries and lists last. */
static void lay_out(Plan *plan, int *room) {
  const int nz = plan->nz, stages = plan->stages;
  *plan = bare_plan(plan->n, nz, stages, plan->chains, room);
  room += handed_size(plan->n, stages, plan->chains);
  plan->first_entry = room, room += stages + 1;
  plan->first_boundary = room, room += stages + 1;
  plan->first_list = room, room += stages;
  plan->entry = room, room += nz;
  plan->target = room, room += nz;
  plan->boundary = room;
}

static int padded(int rows) { return (rows + LANES - 1) / LANES * LANES; }

/* Columns of a front, and of a panel, are this far apart: zeros follow, in which whole vectors may end. */
static int column_stride(int rows) { return padded(rows) + TILE_VECTORS * LANES; }

static int panel_stride(int rows) { return padded(rows) + LANES; }

enum { TOO_SMALL = -1, NO_MEMORY = -2 };

static int chain_end(const Plan *plan, int chain) {
  return chain + 1 < plan->chains ? plan->chain[chain + 1] : plan->stages;
}

static int trunk_stage(const Plan *plan) { return plan->chain[plan->chains - 1]; }

/* Position at which the trunk's unknowns begin. */
static int trunk_position(const Plan *plan) { return plan->first[trunk_stage(plan)]; }

/* The stages that hand their boundaries to stage s, which lies in this chain: from the first chain on, the last stages
 * of chains, or the stage before. */
static int givers(const Plan *plan, int s, int chain) {
  return s > plan->chain[chain] ? 1 : chain == plan->chains - 1 ? chain : 0;
}

static int giver(const Plan *plan, int s, int chain, int k) {
  return s > plan->chain[chain] ? s - 1 : chain_end(plan, k) - 1;
}

/* What making a plan needs on the way. */
typedef struct {
  int *position; /* (n) of each index */
  int *stage_of; /* (n) by position */
  int *slot;     /* (n) by position, in the front of one stage */
} Scratch;

/* Sort the entries by the stage that eliminates the earlier of their two positions. */
static void sort_entries(Plan *plan, const int *irn, const int *icn, const Scratch *scratch) {
  int *count = plan->first_entry;
  memset(count, 0, sizeof(int) * (size_t)(plan->stages + 1));
  for (int sort = 0; sort < 2; sort++) {
    for (int e = 0; e < plan->nz; e++) {
      const int p = scratch->position[irn[e] - 1], q = scratch->position[icn[e] - 1];
      const int s = scratch->stage_of[p < q ? p : q];
      if (sort)
        plan->entry[count[s]++] = e;
      else
        count[s + 1]++;
    }
    if (sort)
      for (int s = plan->stages; s > 0; s--) count[s] = count[s - 1];
    else
      for (int s = 0; s < plan->stages; s++) count[s + 1] += count[s];
  }
  count[0] = 0;
}

/* Find the boundaries: a front reaches as far as its entries do, and as the front before it did. Returns their total
 * length, or TOO_SMALL. */
static int find_boundaries(Plan *plan, const int *irn, const int *icn, int space, const Scratch *scratch) {
  int total = 0, chain = 0, *seen = scratch->slot;
  for (int p = 0; p < plan->n; p++) seen[p] = -1;
  plan->first_boundary[0] = 0;
  for (int s = 0; s < plan->stages; s++) {
    const int begin = total, next = plan->first[s + 1];
    while (s == chain_end(plan, chain)) chain++;
    if (total + plan->n - next > space) return TOO_SMALL;
#define REACH(p) \
  if ((p) >= next && seen[p] != s) seen[p] = s, plan->boundary[total++] = (p)
    for (int t = plan->first_entry[s]; t < plan->first_entry[s + 1]; t++) {
      const int p = scratch->position[irn[plan->entry[t]] - 1], q = scratch->position[icn[plan->entry[t]] - 1];
      REACH(p > q ? p : q);
    }
    for (int g = 0; g < givers(plan, s, chain); g++) {
      const int from = giver(plan, s, chain, g);
      for (int k = plan->first_boundary[from]; k < plan->first_boundary[from + 1]; k++) REACH(plan->boundary[k]);
    }
    qsort(plan->boundary + begin, (size_t)(total - begin), sizeof(int), ascending);
    plan->first_boundary[s + 1] = total;
  }
  return total;
}

/* Make the lists of a stage's pairs from the places where their columns may have nonzeros, `marks`, a row of `size`
 * for each column: what a pair with c = 0 fills is what its constraint's rows share with all its rows. Returns the
 * length of the lists, or TOO_SMALL. */
static int list_pairs(int pairs, int size, unsigned char *marks, int *lists, int space) {
  int length = 0;
  for (int k = 0; k < 2 * pairs; k += 2) {
    const unsigned char *b = marks + (size_t)k * (size_t)size, *a = b + size;
    int count_b = 0, count_a = 0;
    for (int i = k + 2; i < size; i++) count_b += b[i], count_a += a[i];
    if (length + LIST_HEADER + count_b + count_a > space) return TOO_SMALL;
    int *list = lists + length, *rows_b = list + LIST_HEADER, *rows_a = rows_b + count_b;
    for (int i = k + 2, at_b = 0, at_a = 0; i < size; i++) {
      if (b[i]) rows_b[at_b++] = i;
      if (a[i]) rows_a[at_a++] = i;
    }
    list[ROWS_OF_VARIABLE] = count_b, list[ROWS_OF_CONSTRAINT] = count_a;
    length += length_of_list(list);
    for (int t = 0; t < count_a; t++)
      for (int u = 0; u < count_b + count_a; u++) {
        const int i = rows_a[t], j = rows_b[u], low = i < j ? i : j, high = i < j ? j : i;
        if (low < 2 * pairs) marks[(size_t)low * (size_t)size + (size_t)high] = 1;
      }
  }
  return length;
}

/* Give the entries their targets and list the rows of the pairs. Returns the length of the lists, or a failure. */
static int find_targets(Plan *plan, const int *irn, const int *icn, int space, const Scratch *scratch) {
  const int boundaries = plan->first_boundary[plan->stages], size = plan->size;
  int *slot = scratch->slot, *handed_to = plan->boundary + boundaries, most = 1, length = 0, chain = 0;
  for (int s = 0; s < plan->stages; s++) most = plan->pairs[s] > most ? plan->pairs[s] : most;
  unsigned char *marks = malloc(2 * (size_t)most * (size_t)size);
  if (!marks) return NO_MEMORY;
  for (int s = 0; s < plan->stages && length >= 0; s++) {
    const int paired = 2 * plan->pairs[s], limit = size - boundary_of(plan, s);
    while (s == chain_end(plan, chain)) chain++;
    memset(marks, 0, (size_t)paired * (size_t)size);
    for (int p = plan->first[s], i = 0; p < plan->first[s + 1]; p++, i++)
      slot[p] = i < paired ? i : limit - candidates_of(plan, s) + i - paired;
    for (int k = plan->first_boundary[s], i = limit; i < size; k++, i++) slot[plan->boundary[k]] = i;
#define MARK(low, high) \
  if ((low) < paired) marks[(size_t)(low) * (size_t)size + (size_t)(high)] = 1
    for (int t = plan->first_entry[s]; t < plan->first_entry[s + 1]; t++) {
      const int p = scratch->position[irn[plan->entry[t]] - 1], q = scratch->position[icn[plan->entry[t]] - 1];
      const int low = slot[p < q ? p : q], high = slot[p < q ? q : p];
      plan->target[t] = low * plan->stride + high;
      MARK(low, high);
    }
    for (int g = 0; g < givers(plan, s, chain); g++) {
      const int from = giver(plan, s, chain, g), begin = plan->first_boundary[from];
      for (int k = begin; k < plan->first_boundary[from + 1]; k++) {
        handed_to[k] = slot[plan->boundary[k]];
        for (int l = begin; l < k; l++) MARK(handed_to[l], handed_to[k]);
      }
    }
    plan->first_list[s] = length;
    const int more = list_pairs(plan->pairs[s], size, marks, plan->lists + length, space - length);
    length = more < 0 ? more : length + more;
  }
  free(marks);
  return length;
}

/* Every front has as many slots as the largest: columns of pairs, as many as the stage with most of them has, so that a
 * column that was a pair's is never a candidate's; its other unknowns, `delayed` candidates, and all of its pairs again,
 * which are candidates when their pivots are not acceptable. */
static void set_size(Plan *plan, int delayed) {
  int most = 0;
  for (int s = 0; s < plan->stages; s++) most = plan->pairs[s] > most ? plan->pairs[s] : most;
  plan->size = 0;
  for (int s = 0; s < plan->stages; s++) {
    const int size = 2 * most + 2 * plan->pairs[s] + candidates_of(plan, s) + boundary_of(plan, s) + delayed;
    plan->size = size > plan->size ? size : plan->size;
  }
  plan->stride = column_stride(plan->size);
}

/* Complete a bare plan in `room`, which has `room_size` integers, with space in the fronts for `delayed` candidates;
 * the order is copied. Returns how many integers it takes, TOO_SMALL (which it may say for want of n) or NO_MEMORY. */
static int find_plan(Plan *plan, const int *irn, const int *icn, int delayed, int *room, int room_size) {
  const int n = plan->n, stages = plan->stages, fixed = plan_integers(plan);
  if (room_size < fixed) return TOO_SMALL;
  memcpy(room, plan->order, sizeof(int) * (size_t)handed_size(n, stages, plan->chains));
  lay_out(plan, room);
  int *scratch = malloc(3 * sizeof(int) * (size_t)n);
  if (!scratch) return NO_MEMORY;
  const Scratch parts = {scratch, scratch + n, scratch + 2 * n};
  for (int p = 0; p < n; p++) parts.position[plan->order[p]] = p;
  for (int s = 0; s < stages; s++)
    for (int p = plan->first[s]; p < plan->first[s + 1]; p++) parts.stage_of[p] = s;

  sort_entries(plan, irn, icn, &parts);
  const int boundaries = find_boundaries(plan, irn, icn, room_size - fixed, &parts);
  int lists = boundaries;
  if (boundaries >= 0) {
    set_size(plan, delayed);
    plan->lists = plan->boundary + 2 * boundaries;
    lists = find_targets(plan, irn, icn, room_size - fixed - 2 * boundaries, &parts);
  }
  free(scratch);
  return lists < 0 ? lists : fixed + 2 * boundaries + lists;
}

/* The plan made last, with what it was made for: solves alike follow each other, and each makes its plan twice. The room
 * has order, pattern and plan, one after the other. */
static struct {
  int n, nz, stages, chains, delayed, length;
  int *room;
} last_plan;

/* More integers than these are not kept. */
static const size_t MOST_KEPT = 1 << 20;

static int is_last(const Plan *plan, const int *irn, const int *icn, int delayed) {
  const int n = plan->n, nz = plan->nz, ordered = handed_size(n, plan->stages, plan->chains);
  const int *room = last_plan.room;
  return room && n == last_plan.n && nz == last_plan.nz && delayed == last_plan.delayed &&
         plan->stages == last_plan.stages && plan->chains == last_plan.chains &&
         !memcmp(room, plan->order, sizeof(int) * (size_t)ordered) &&
         !memcmp(room + ordered, irn, sizeof(int) * (size_t)nz) &&
         !memcmp(room + ordered + nz, icn, sizeof(int) * (size_t)nz);
}

static void keep_last(const Plan *plan, const int *irn, const int *icn, int delayed, const int *made, int length) {
  const size_t ordered = (size_t)handed_size(plan->n, plan->stages, plan->chains), nz = (size_t)plan->nz;
  const size_t size = ordered + 2 * nz + (size_t)length;
  free(last_plan.room);
  int *room = last_plan.room = size > MOST_KEPT ? NULL : malloc(sizeof(int) * size);
  if (!room) return;
  last_plan.n = plan->n, last_plan.nz = plan->nz, last_plan.stages = plan->stages, last_plan.chains = plan->chains;
  last_plan.delayed = delayed, last_plan.length = length;
  memcpy(room, plan->order, sizeof(int) * ordered);
  memcpy(room + ordered, irn, sizeof(int) * nz);
  memcpy(room + ordered + nz, icn, sizeof(int) * nz);
  memcpy(room + ordered + 2 * nz, made, sizeof(int) * (size_t)length);
}

/* Set a plan out in `room`, where it is complete, with space in the fronts for `delayed` candidates. */
static void read_plan(Plan *plan, int delayed, int *room) {
  lay_out(plan, room);
  set_size(plan, delayed);
  plan->lists = plan->boundary + 2 * plan->first_boundary[plan->stages];
}

/* `find_plan`, unless it was found last. */
static int make_plan(Plan *plan, const int *irn, const int *icn, int delayed, int *room, int room_size) {
  if (!is_last(plan, irn, icn, delayed)) {
    const int length = find_plan(plan, irn, icn, delayed, room, room_size);
    if (length >= 0) keep_last(plan, irn, icn, delayed, room, length);
    return length;
  }
  const int length = last_plan.length, *made = last_plan.room + handed_size(plan->n, plan->stages, plan->chains);
  if (length > room_size) return TOO_SMALL;
  memcpy(room, made + 2 * plan->nz, sizeof(int) * (size_t)length);
  read_plan(plan, delayed, room);
  return length;
}

/* ---- dense pieces ---- */

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

/* Of whole vectors; with several sums under way, for one alone would wait for itself at every step. */
static double dot(const double *restrict x, const double *restrict y, int n) {
  vector sum[4] = {0};
  int i = 0;
  for (; i + 3 * LANES < n; i += 4 * LANES)
    for (int u = 0; u < 4; u++) sum[u] += *(const vector *)(x + i + u * LANES) * *(const vector *)(y + i + u * LANES);
  for (; i < n; i += LANES) sum[0] += *(const vector *)(x + i) * *(const vector *)(y + i);
  const vector all = (sum[0] + sum[1]) + (sum[2] + sum[3]);
  double result = 0;
  for (int l = 0; l < LANES; l++) result += all[l];
  return result;
}

/* Keep a vector in a register: the compiler would read it from memory again for each column, and loads are what limits
 * a tile. */
#ifdef __AVX__
#define IN_REGISTER(x) __asm__("" : "+v"(x))
#else
#define IN_REGISTER(x) (void)(x)
#endif

#define INLINE static inline __attribute__((always_inline))

/* A tile of `columns` columns and `vectors` vectors of rows: C -= A B', with A and B given by their k columns. The
 * numbers of columns and vectors are constants wherever it is inlined, small enough for all sums to be in registers. */
INLINE void tile(int columns, int vectors, int k, const double *A, int lda, const double *B, int ldb, double *C,
                 int ldc) {
  vector sum[TILE_COLUMNS][COLUMN_VECTORS] = {0};
  for (int p = 0; p < k; p++, A += lda, B += ldb) {
    vector a[COLUMN_VECTORS];
    for (int v = 0; v < vectors; v++) {
      a[v] = *(const vector *)(A + v * LANES);
      if (columns > 1) IN_REGISTER(a[v]);
    }
    for (int c = 0; c < columns; c++)
      for (int v = 0; v < vectors; v++) sum[c][v] += a[v] * B[c];
  }
  for (int c = 0; c < columns; c++)
    for (int v = 0; v < vectors; v++) *(vector *)(C + (size_t)c * (size_t)ldc + v * LANES) -= sum[c][v];
}

/* `tile` over `rows` rows. */
static void tiles(int rows, int k, const double *A, int lda, const double *B, int ldb, double *C, int ldc) {
  int i = 0;
  for (; i + 2 * LANES < rows; i += 3 * LANES) tile(TILE_COLUMNS, 3, k, A + i, lda, B, ldb, C + i, ldc);
  if (i + LANES < rows)
    tile(TILE_COLUMNS, 2, k, A + i, lda, B, ldb, C + i, ldc);
  else if (i < rows)
    tile(TILE_COLUMNS, 1, k, A + i, lda, B, ldb, C + i, ldc);
}

/* C -= A b' for one column C and the k numbers b. */
static void subtract_columns(int rows, int k, const double *A, int lda, const double *b, int ldb, double *C) {
  int i = 0;
  for (; i + 7 * LANES < rows; i += 8 * LANES) tile(1, 8, k, A + i, lda, b, ldb, C + i, 0);
  if (i + 3 * LANES < rows) tile(1, 4, k, A + i, lda, b, ldb, C + i, 0), i += 4 * LANES;
  if (i + 2 * LANES < rows)
    tile(1, 3, k, A + i, lda, b, ldb, C + i, 0);
  else if (i + LANES < rows)
    tile(1, 2, k, A + i, lda, b, ldb, C + i, 0);
  else if (i < rows)
    tile(1, 1, k, A + i, lda, b, ldb, C + i, 0);
}

/* C -= A B' on the lower triangle of C (m x m); tiles reach above the diagonal, and into the zeros below. */
static void subtract_product(int m, int k, const double *A, int lda, const double *B, int ldb, double *C, int ldc) {
  for (int j = 0; j < m; j += TILE_COLUMNS)
    tiles(m - j, k, A + j, lda, B + j, ldb, C + (size_t)j * (size_t)ldc + j, ldc);
}

/* ---- factors of one stage, as they lie in the caller's arrays ----
 *
 * Integers: the header; for each pair the places of its list and of its reals; lists that are not the plan's; the
 * places of the slots, but for the pairs'; where each row of the panel was before pivoting; 1 or 2 for each column,
 * the size of its pivot.
 * Reals: of a pair the inverse of its pivot (3 numbers), its columns by their lists; D inverse, 2 numbers a column;
 * the panel of L without its unit diagonal, zero above it.
 *
 * "Place" is where a solve keeps an unknown. Every chain has places for the trunk's unknowns behind its own, to gather
 * what it takes from them, so that no chain waits for another. */

enum { PAIRS, FIRST, PAIRED, GATHERED, PLACES, ROWS, ORIGINS, COLUMNS, KINDS, DIAGONAL, PANEL, STAGE_HEADER };

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

static int place_of(const Plan *plan, int chain, int position) {
  const int trunk = trunk_position(plan), branches = plan->chains - 1;
  if (position >= trunk) return position - trunk + trunk_places(plan, chain);
  if (chain == branches) /* a chain's unknown that was delayed to the trunk */
    for (chain = 0; plan->first[chain_end(plan, chain)] <= position;) chain++;
  return position - plan->first[plan->chain[chain]] + own_places(plan, chain);
}

typedef struct {
  int dense;     /* first slot of the candidates */
  int limit;     /* first slot of the boundary */
  double *a;     /* the front */
  int *position; /* of each slot, before pivoting */
  int *origin;   /* slot before pivoting, from the first candidate on */
} Front;

/* What a front leaves behind when all is done: delayed candidates and the boundary. */
typedef struct {
  int delayed, size; /* how many candidates, how many in all */
  int stride;
  const double *a;   /* columns, lower triangle */
  const int *position;  /* of the delayed candidates */
  const int *handed_to; /* slots of the boundary in the front that it is handed to */
} Remainder;

typedef struct {
  int *integers; /* next free */
  double *reals;
  int negative; /* eigenvalues so far */
} Factors;

static double *column_at(const Plan *plan, const Front *front, int j) {
  return front->a + (size_t)j * (size_t)plan->stride;
}

static int negative_of_two(double a, double b, double det) { return det < 0 ? 1 : (a + b < 0 ? 2 : 0); }

/* The list of a pair by its values, after a pair with c != 0, which fills more than the plan knows. */
static void list_by_values(const Plan *plan, const Front *front, int k, int paired, int *list) {
  int *next = list + LIST_HEADER;
  for (int c = 0; c < 2; c++) {
    const double *column = column_at(plan, front, k + c);
    const int *begin = next;
    for (int i = k + 2; i < plan->size; i = i == paired - 1 ? front->dense : i + 1)
      if (column[i] != 0) *next++ = i;
    list[c] = (int)(next - begin);
  }
}

/* Whether a pair reaches candidates that were delayed to this front, which its list in the plan does not have. */
static int reaches_delayed(const Plan *plan, const Front *front, int k, int delayed) {
  const double *b = column_at(plan, front, k) + front->dense, *a = b + plan->stride;
  for (int i = 0; i < delayed; i++)
    if (a[i] != 0 || b[i] != 0) return 1;
  return 0;
}

/* The plan's list of a pair and the delayed candidates, which stand between the pairs and the other candidates. */
static void list_with_delayed(const Plan *plan, const Front *front, int k, int delayed, const int *known, int *list) {
  const int *from = known + LIST_HEADER;
  int *next = list + LIST_HEADER;
  for (int c = 0; c < 2; c++) {
    const double *column = column_at(plan, front, k + c);
    const int *begin = next, *end = from + known[c];
    while (from < end && *from < front->dense) *next++ = *from++;
    for (int i = front->dense; i < front->dense + delayed; i++)
      if (column[i] != 0) *next++ = i;
    while (from < end) *next++ = *from++;
    list[c] = (int)(next - begin);
  }
}

/* Eliminate the pair in slots k, k+1, whose rows are listed; 0 when its pivot is not acceptable.
 *
 * With b and a the columns below the pivot and [p q; q r] = [S g; g c]^-1, the rest loses p bb' + q (ab' + ba') + r aa';
 * p is zero where c is. */
static int eliminate_pair(const Plan *plan, Front *front, int k, const int *list, Factors *out) {
  const int count_b = list[ROWS_OF_VARIABLE], count_a = list[ROWS_OF_CONSTRAINT];
  const int *rows_b = list + LIST_HEADER, *rows_a = rows_b + count_b;
  double *b = column_at(plan, front, k), *a = b + plan->stride;
  double *pivot = out->reals, *kept_b = pivot + 3, *kept_a = kept_b + count_b;
  const double S = b[k], g = b[k + 1], c = a[k + 1], det = S * c - g * g;
  for (int t = 0; t < count_a; t++) kept_a[t] = a[rows_a[t]];
  if (fabs(det) < 0.5 * g * g || largest(kept_a, count_a) > PAIR_GROWTH * fabs(g) || fabs(g) <= ZERO) return 0;
  out->negative += negative_of_two(S, c, det);

  const double p = c / det, q = -g / det, r = S / det;
  pivot[0] = p, pivot[1] = q, pivot[2] = r;
  for (int t = 0; t < count_b; t++) kept_b[t] = b[rows_b[t]], b[rows_b[t]] = 0; /* zeros for the next stage's pairs */
  for (int t = 0; t < count_a; t++) a[rows_a[t]] = 0;
  b[k] = b[k + 1] = a[k + 1] = 0;
  out->reals = kept_a + count_a;

  for (int t = 0; t < count_a; t++) {
    const int row = rows_a[t];
    const double z_a = r * kept_a[t], z_b = q * kept_a[t];
    double *column = column_at(plan, front, row);
    for (int u = t; u < count_a; u++) column[rows_a[u]] -= z_a * kept_a[u];
    int u = 0;
    for (; u < count_b && rows_b[u] < row; u++) column_at(plan, front, rows_b[u])[row] -= z_b * kept_b[u];
    if (u < count_b && rows_b[u] == row) column[row] -= z_b * kept_b[u]; /* once for ab', once for ba' */
    for (; u < count_b; u++) column[rows_b[u]] -= z_b * kept_b[u];
  }
  for (int t = 0; t < count_b && p != 0; t++) {
    double *column = column_at(plan, front, rows_b[t]);
    for (int u = t; u < count_b; u++) column[rows_b[u]] -= p * kept_b[t] * kept_b[u];
  }
  return 1;
}

/* Make candidates of the pairs from slot k on: they join those there are, on their left. */
static void join_candidates(const Plan *plan, Front *front, int k, int paired) {
  const int dense = front->dense, shift = dense - paired;
  for (int j = paired - 1; j >= k; j--) {
    double *from = column_at(plan, front, j), *to = column_at(plan, front, j + shift);
    for (int i = paired - 1; i >= j; i--) to[i + shift] = from[i];
    memcpy(to + dense, from + dense, sizeof(double) * (size_t)(plan->size - dense));
    memset(from + j, 0, sizeof(double) * (size_t)(plan->size - j));
    front->origin[j + shift] = j;
  }
  front->dense = k + shift;
}

/* ---- elimination of candidates ----
 *
 * Their part of the front is written out on both sides of the diagonal first, so that a column is all there is to know
 * of a candidate: it can be brought up to date, judged and exchanged without the others. */

static void mirror_candidates(const Plan *plan, const Front *front) {
  for (int j = front->dense; j < front->limit; j++) {
    const double *column = column_at(plan, front, j);
    for (int i = j + 1; i < front->limit; i++) column_at(plan, front, i)[j] = column[i];
  }
}

/* The columns that were eliminated: column k of the front keeps W = L D, the panel has L. */
typedef struct {
  double *panel;
  int stride;
  int *done; /* by slot: the columns before it were subtracted from this candidate's */
} Panel;

static double *panel_column(const Front *front, const Panel *panel, int j) {
  return panel->panel + (size_t)(j - front->dense) * (size_t)panel->stride - front->dense; /* by slot */
}

/* Subtract from candidate j, rows k and below, what the columns before k, eliminated already, take from it. Returns the
 * column. */
static const double *bring_up_to_date(const Plan *plan, const Front *front, const Panel *panel, int j, int k) {
  const int from = panel->done[j];
  double *column = column_at(plan, front, j);
  panel->done[j] = k;
  if (from < k)
    subtract_columns(plan->size - k, k - from, column_at(plan, front, from) + k, plan->stride,
                     panel_column(front, panel, from) + j, panel->stride, column + k);
  return column;
}

#define SWAP(type, x, y) do { const type kept = x; x = y; y = kept; } while (0)

/* Exchange two candidates from slot k on, the first that is not eliminated. */
static void exchange(const Plan *plan, Front *front, const Panel *panel, int k, int i, int j) {
  if (i == j) return;
  double *column_i = column_at(plan, front, i), *column_j = column_at(plan, front, j);
  for (int row = k; row < plan->size; row++) SWAP(double, column_i[row], column_j[row]);
  for (int c = front->dense; c < front->limit; c++)
    SWAP(double, column_at(plan, front, c)[i], column_at(plan, front, c)[j]);
  for (int c = front->dense; c < k; c++)
    SWAP(double, panel_column(front, panel, c)[i], panel_column(front, panel, c)[j]);
  SWAP(int, front->origin[i], front->origin[j]);
  SWAP(int, panel->done[i], panel->done[j]);
}

/* Largest entry of a column in slots from k on, but for the slots i and j, i <= j. */
static double largest_but(const Plan *plan, const double *column, int k, int i, int j) {
  const double before = largest(column + k, i - k), between = i < j ? largest(column + i + 1, j - i - 1) : 0;
  const double behind = largest(column + j + 1, plan->size - j - 1);
  return fmax(before, fmax(between, behind));
}

/* The slot of the largest entry of candidate j among the candidates from k on; -1 without another one. */
static int partner_of(const Front *front, const double *column, int k, int j) {
  int partner = -1;
  for (int i = k; i < front->limit; i++)
    if (i != j && (partner < 0 || fabs(column[i]) > fabs(column[partner]))) partner = i;
  return partner;
}

/* Search the candidates k, k+1, ... for a pivot: 1 and its slot j, or 2 and its slots j, t, or 0.
 *
 * A pivot is accepted when no entry of L exceeds 1/threshold. */
static int search_pivot(const Plan *plan, const Front *front, const Panel *panel, int k, double threshold, int *j,
                        int *t) {
  for (*j = k; *j < front->limit; (*j)++) {
    const double *column = bring_up_to_date(plan, front, panel, *j, k), d = column[*j];
    if (fabs(d) > ZERO && fabs(d) >= threshold * largest_but(plan, column, k, *j, *j)) return 1;
    if ((*t = partner_of(front, column, k, *j)) < 0) continue;
    /* 2x2 with the largest candidate of the column: |P^-1| times the columns' largest entries must stay small. */
    const double *other = bring_up_to_date(plan, front, panel, *t, k), e = other[*t], o = column[*t];
    const double det = d * e - o * o, size_of = fabs(det);
    const int low = *j < *t ? *j : *t, high = *j < *t ? *t : *j;
    const double rest_j = largest_but(plan, column, k, low, high), rest_t = largest_but(plan, other, k, low, high);
    if (size_of > ZERO * fabs(o) && threshold * (fabs(e) * rest_j + fabs(o) * rest_t) <= size_of &&
        threshold * (fabs(o) * rest_j + fabs(d) * rest_t) <= size_of)
      return 2;
  }
  return 0;
}

/* Find the next pivot and bring it to slots k, k+1; its size, or 0. The last stage takes worse pivots, if it must. */
static int next_pivot(const Plan *plan, Front *front, const Panel *panel, int k, double threshold, int last) {
  const double thresholds[] = {threshold, 1e-8, 0};
  for (int round = 0; round < (last ? 3 : 1); round++) {
    int j, t;
    const int found = search_pivot(plan, front, panel, k, thresholds[round], &j, &t);
    if (!found) continue;
    const int low = found == 2 && t < j ? t : j, high = found == 2 && t < j ? j : t;
    exchange(plan, front, panel, k, k, low);
    if (found == 2) exchange(plan, front, panel, k, k + 1, high);
    return found;
  }
  return 0;
}

/* Eliminate candidates while acceptable pivots are found; returns the slot where it stopped. `diagonal` (2 a column)
 * and `kinds` receive D inverse. */
static int eliminate_candidates(const Plan *plan, Front *front, const Panel *panel, double threshold, int last,
                                double *diagonal, int *kinds, int *negative) {
  const int stride = plan->stride, size = plan->size, first = front->dense;
  int k = first, pivot;
  mirror_candidates(plan, front);
  for (int j = k; j < front->limit; j++) panel->done[j] = k;
  while (k < front->limit && (pivot = next_pivot(plan, front, panel, k, threshold, last))) {
    const double *restrict w = column_at(plan, front, k), *restrict v = w + stride;
    double *restrict l = panel_column(front, panel, k), *restrict m = l + panel->stride;
    double *D = diagonal + 2 * (k - first);
    const int below = k + pivot;
    memset(l + first, 0, sizeof(double) * (size_t)(below - first));
    memset(l + size, 0, sizeof(double) * (size_t)(panel->stride - (size - first)));
    if (pivot == 1) {
      const double inverse = 1 / w[k];
      *negative += inverse < 0;
      D[0] = inverse, D[1] = 0;
#pragma omp simd
      for (int i = below; i < size; i++) l[i] = inverse * w[i];
    } else {
      const double d = w[k], o = w[k + 1], e = v[k + 1], det = d * e - o * o;
      const double p = e / det, q = -o / det, r = d / det;
      *negative += negative_of_two(d, e, det);
      D[0] = p, D[1] = q, D[2] = r, D[3] = q;
      memset(m + first, 0, sizeof(double) * (size_t)(below - first));
      memset(m + size, 0, sizeof(double) * (size_t)(panel->stride - (size - first)));
#pragma omp simd
      for (int i = below; i < size; i++) l[i] = p * w[i] + q * v[i], m[i] = q * w[i] + r * v[i];
      kinds[k + 1 - first] = 2;
    }
    kinds[k - first] = pivot;
    k = below;
  }
  for (int j = k; j < front->limit; j++) bring_up_to_date(plan, front, panel, j, k);
  return k;
}

/* ---- the whole ---- */

/* Integers of the factors' header: what the solve must know. The table follows: where each stage's factors lie. */
enum { STAGE_COUNT, CHAIN_COUNT, THREADS, TABLE, SIZE, HEADER };

/* Room in the fronts for candidates that are delayed: doubled as long as the caller's arrays allow, and less where the
 * systems are so large that the arrays would have more elements than MA27's integers count. */
static const int DELAYED_ROOM = 48;
static const int LEAST_DELAYED_ROOM = 6;

static int front_reals(const Plan *plan) { return plan->stride * (plan->size + TILE_COLUMNS); }

/* What a thread works with: a front and what is set aside of it; by slot the position, the origin, the positions of
 * delayed candidates, slots to go to, and `done`. */
static int thread_reals(const Plan *plan) { return 2 * front_reals(plan); }

static int thread_integers(const Plan *plan) { return 5 * plan->size; }

typedef struct {
  long long integers, reals;
  int remainder; /* size of the largest remainder that a chain leaves */
  int threads;
} Space;

/* Whether MA27's integers can say it, so many times. */
static int countable(Space space, int times) {
  return times * space.integers <= INT_MAX && times * space.reals <= INT_MAX;
}

/* Space that the factors of a stage may take, with room for `delayed` candidates and for pairs that join them. */
static Space stage_space(const Plan *plan, int s, int delayed) {
  const int pairs = plan->pairs[s], candidates = 2 * pairs + candidates_of(plan, s) + delayed;
  const int rows = candidates + boundary_of(plan, s), all = 2 * pairs + rows;
  return (Space){.integers = STAGE_HEADER + pairs * (2 + LIST_HEADER + 2 * all) + 2 * rows + candidates,
                 .reals = pairs * (3 + 2 * all) + candidates * (2 + panel_stride(rows)) + LANES,
                 .remainder = boundary_of(plan, s) + delayed};
}

/* Space that the factorisation takes in all, with room for `delayed` candidates in every front; of the plan, which
 * takes `planned` integers, only the boundaries are asked. */
static Space space_for(const Plan *plan, int planned, int delayed, int threads) {
  Plan wider = *plan;
  set_size(&wider, delayed);
  Space space = {.threads = threads < plan->chains ? threads : plan->chains};
  for (int s = 0; s < plan->stages; s++) {
    const Space stage = stage_space(plan, s, delayed);
    space.integers += stage.integers, space.reals += stage.reals;
  }
  const int branches = plan->chains - 1;
  for (int c = 0; c < branches; c++) {
    const int size = stage_space(plan, chain_end(plan, c) - 1, delayed).remainder;
    space.remainder = size > space.remainder ? size : space.remainder;
  }
  const long long remainders = (long long)branches * space.remainder;
  space.reals += plan->nz + (long long)space.threads * thread_reals(&wider) + remainders * space.remainder;
  space.integers += HEADER + planned + 2 * plan->stages + (long long)space.threads * thread_integers(&wider);
  space.integers += remainders;
  return space;
}

/* How many unknowns of a remainder change their slots, which are to be `to`; those behind them do not. */
static int leading(const Plan *plan, const Remainder *from, const int *to) {
  int count = from->size;
  while (count > 0 && to[count - 1] == plan->size - from->size + count - 1) count--;
  return count;
}

/* Add the first `columns` of a remainder to a front, its unknowns going to the slots `to`; the first `moved` of them
 * change their slots. */
static void add_remainder(const Plan *plan, Front *front, const Remainder *from, int columns, const int *to, int moved) {
  const size_t stride = (size_t)plan->stride;
  const int size = from->size, end = plan->size - size;
  for (int j = 0; j < columns; j++) {
    const double *column = from->a + (size_t)j * (size_t)from->stride;
    for (int i = j; i < moved; i++) {
      const int low = to[i] < to[j] ? to[i] : to[j], high = to[i] < to[j] ? to[j] : to[i];
      front->a[(size_t)low * stride + (size_t)high] += column[i];
    }
    double *target = front->a + (size_t)to[j] * stride + end;
    for (int i = j < moved ? moved : j; i < size; i++) target[i] += column[i];
  }
}

/* Clear the columns of the slots from `begin` to `end`. */
static void clear_columns(const Plan *plan, const Front *front, int begin, int end) {
  for (int j = begin; j < end; j++)
    memset(column_at(plan, front, j) + j, 0, sizeof(double) * (size_t)(plan->size - j));
}

/* Assemble the front of stage s: its positions, the `count` remainders handed to it, the entries of the matrix. What the
 * stage before left lies in the front itself (`in_place`), where most of it stays; `aside` has room for a front, `to`
 * for its slots. */
static void assemble(const Plan *plan, int s, const double *values, Front *front, const Remainder *handed_on, int count,
                     int in_place, double *aside, int *to) {
  const int size = plan->size, paired = 2 * plan->pairs[s];
  int delayed = 0;
  for (int r = 0; r < count; r++) delayed += handed_on[r].delayed;
  front->limit = size - boundary_of(plan, s);
  front->dense = front->limit - candidates_of(plan, s) - delayed;
  int *position = front->position, slot = front->dense;
  for (int i = 0; i < paired; i++) position[i] = plan->first[s] + i;
  for (int r = 0; r < count; r++)
    for (int i = 0; i < handed_on[r].delayed; i++) position[slot++] = handed_on[r].position[i];
  for (int p = plan->first[s] + paired; slot < front->limit; slot++) position[slot] = p++;
  for (int k = plan->first_boundary[s]; slot < size; slot++) position[slot] = plan->boundary[k++];
  for (int i = front->dense; i < size; i++) front->origin[i] = i;

  slot = front->dense;
  if (!in_place) clear_columns(plan, front, slot, size);
  for (int r = 0; r < count; r++) {
    Remainder from = handed_on[r];
    for (int i = 0; i < from.delayed; i++) to[i] = slot++;
    memcpy(to + from.delayed, from.handed_to, sizeof(int) * (size_t)(from.size - from.delayed));
    const int moved = leading(plan, &from, to), columns = in_place ? moved : from.size;
    if (in_place) {
      for (int j = 0; j < moved; j++)
        memcpy(aside + (size_t)j * (size_t)from.stride + j, from.a + (size_t)j * (size_t)from.stride + j,
               sizeof(double) * (size_t)(from.size - j));
      from.a = aside;
      clear_columns(plan, front, front->dense, size - from.size + moved);
    }
    add_remainder(plan, front, &from, columns, to, moved);
  }
  for (int e = plan->first_entry[s]; e < plan->first_entry[s + 1]; e++)
    front->a[plan->target[e]] += values[plan->entry[e]];
}

/* Eliminate the pairs of stage s, as far as their pivots are acceptable; the others become candidates. The table
 * receives the places of each one's list and reals. Returns how many were eliminated. */
static int eliminate_pairs(const Plan *plan, int s, int delayed, Front *front, const int *iw, const double *reals,
                           int *table, Factors *out) {
  const int paired = 2 * plan->pairs[s], *known = plan->lists + plan->first_list[s];
  int k = 0, all = 0;
  for (; k < paired; k += 2, known += length_of_list(known)) {
    const int *list = out->integers;
    all |= column_at(plan, front, k + 1)[k + 1] != 0;
    if (all)
      list_by_values(plan, front, k, paired, out->integers);
    else if (reaches_delayed(plan, front, k, delayed))
      list_with_delayed(plan, front, k, delayed, known, out->integers);
    else
      list = known;
    table[k] = (int)(list - iw), table[k + 1] = (int)(out->reals - reals);
    if (!eliminate_pair(plan, front, k, list, out)) break;
    if (list != known) out->integers += length_of_list(list);
  }
  if (k < paired) join_candidates(plan, front, k, paired);
  return k / 2;
}

/* Eliminate what can be eliminated of the front of stage s, in this chain, and keep the factors. Returns what is left
 * behind, with the positions of delayed candidates in `waiting`. */
static Remainder eliminate(const Plan *plan, int s, int chain, int delayed, Front *front, double threshold, int *iw,
                           double *reals, int *done, int *waiting, Factors *out) {
  const int size = plan->size, paired = 2 * plan->pairs[s], gathered = front->dense, last = s == plan->stages - 1;
  int *header = out->integers;
  out->integers += STAGE_HEADER + paired;
  const int pairs = eliminate_pairs(plan, s, delayed, front, iw, reals, header + STAGE_HEADER, out);

  const int candidates = front->limit - front->dense, rows = size - front->dense;
  int *places = out->integers, *origins = places + size - gathered, *kinds = origins + rows;
  double *diagonal = out->reals;
  const Panel panel = {diagonal + 2 * candidates, panel_stride(rows), done};
  const int left = eliminate_candidates(plan, front, &panel, threshold, last, diagonal, kinds, &out->negative);
  const int columns = left - front->dense, m = size - front->limit;
  subtract_product(m, columns, column_at(plan, front, front->dense) + front->limit, plan->stride,
                   panel_column(front, &panel, front->dense) + front->limit, panel.stride,
                   column_at(plan, front, front->limit) + front->limit, plan->stride);

  for (int i = gathered; i < size; i++) places[i - gathered] = place_of(plan, chain, front->position[i]);
  memcpy(origins, front->origin + front->dense, sizeof(int) * (size_t)rows);
  header[PAIRS] = pairs, header[FIRST] = place_of(plan, chain, plan->first[s]), header[PAIRED] = paired;
  header[GATHERED] = gathered, header[ROWS] = rows, header[COLUMNS] = columns;
  header[PLACES] = (int)(places - iw), header[ORIGINS] = (int)(origins - iw), header[KINDS] = (int)(kinds - iw);
  header[DIAGONAL] = (int)(diagonal - reals), header[PANEL] = (int)(panel.panel - reals);
  out->integers = kinds + candidates;
  out->reals = panel.panel + (size_t)columns * (size_t)panel.stride;

  for (int i = left; i < front->limit; i++) waiting[i - left] = front->position[front->origin[i]];
  return (Remainder){front->limit - left, size - left, plan->stride, column_at(plan, front, left) + left, waiting,
                     plan->boundary + plan->first_boundary[plan->stages] + plan->first_boundary[s]};
}

/* The zeros that a front begins with: columns of pairs, and below the last slot. */
static void clear(const Plan *plan, Front *front) {
  int paired = 0;
  for (int s = 0; s < plan->stages; s++) paired = 2 * plan->pairs[s] > paired ? 2 * plan->pairs[s] : paired;
  memset(front->a, 0, sizeof(double) * (size_t)paired * (size_t)plan->stride);
  for (int j = paired; j < plan->size + TILE_COLUMNS; j++)
    memset(column_at(plan, front, j) + plan->size, 0, sizeof(double) * (size_t)(plan->stride - plan->size));
}

/* A factorisation under way: what its threads share. */
typedef struct {
  const Plan *plan;
  int room;
  double threshold, *a;
  int *iw, *table; /* where each stage's factors may begin, integers and reals */
  double *thread_reals, *remainder_reals;
  int *thread_integers, *remainder_integers;
  Remainder *remainders; /* of all chains but the trunk */
  int largest_remainder;
  atomic_int negative, crowded, singular, indefinite;
} Factorisation;

/* Copy what the last stage of a chain left to where it may wait for the trunk. */
static void keep_remainder(Factorisation *f, int chain, const Remainder *from) {
  double *a = f->remainder_reals + (size_t)chain * (size_t)f->largest_remainder * (size_t)f->largest_remainder;
  int *position = f->remainder_integers + (size_t)chain * (size_t)f->largest_remainder;
  const size_t size = (size_t)from->size;
  for (size_t j = 0; j < size; j++)
    memcpy(a + j * size + j, from->a + j * (size_t)from->stride + j, sizeof(double) * (size - j));
  memcpy(position, from->position, sizeof(int) * (size_t)from->delayed);
  f->remainders[chain] = *from;
  f->remainders[chain].stride = from->size, f->remainders[chain].a = a, f->remainders[chain].position = position;
}

/* How many unknowns of a stage are multipliers. */
static int multipliers_of(const Plan *plan, int s) {
  int count = 0;
  for (int p = plan->first[s]; p < plan->first[s + 1]; p++) count += plan->order[p] >= plan->first_multiplier;
  return count;
}

/* How many multipliers of later stages have constraints that hold what was eliminated up to a stage. */
static int multipliers_behind(const Plan *plan, int s) {
  int count = 0;
  for (int k = plan->first_boundary[s]; k < plan->first_boundary[s + 1]; k++)
    count += plan->order[plan->boundary[k]] >= plan->first_multiplier;
  return count;
}

/* Eliminate the stages of a chain, its first one with `count` remainders handed on by others. */
static void eliminate_chain(Factorisation *f, int chain, int thread, const Remainder *handed_on, int count) {
  const Plan *plan = f->plan;
  const int first = plan->chain[chain], size = plan->size, is_trunk = chain == plan->chains - 1;
  double *reals = f->thread_reals + (size_t)thread * (size_t)thread_reals(plan);
  int *integers = f->thread_integers + (size_t)thread * (size_t)thread_integers(plan);
  int *waiting = integers + 2 * size, *to = waiting + size, *done = to + size;
  Factors out = {f->iw + f->table[2 * first], f->a + f->table[2 * first + 1], 0};
  Front front = {0, 0, reals, integers, integers + size};
  clear(plan, &front);
  Remainder left = {0};
  int multipliers = 0, own = plan->first_multiplier < plan->n; /* whether only the chain's own were eliminated so far */
  for (int s = first; s < chain_end(plan, chain) && !f->indefinite; s++) {
    int delayed = 0;
    for (int r = 0; r < count; r++) delayed += handed_on[r].delayed;
    own &= s > first || delayed == 0;
    multipliers += multipliers_of(plan, s);
    if (delayed > f->room) {
      f->crowded = 1;
      return;
    }
    assemble(plan, s, f->a, &front, handed_on, count, s > first, reals + front_reals(plan), to);
    f->table[2 * s] = (int)(out.integers - f->iw);
    left = eliminate(plan, s, chain, delayed, &front, f->threshold, f->iw, f->a, done, waiting, &out);
    handed_on = &left, count = 1;
    if (own && out.negative > multipliers + multipliers_behind(plan, s)) f->indefinite = 1;
  }
  if (f->indefinite) return;
  f->negative += out.negative;
  if (!is_trunk)
    keep_remainder(f, chain, &left);
  else if (left.delayed > 0)
    f->singular = 1;
}

static void eliminate_branch(void *context, int chain, int thread) { eliminate_chain(context, chain, thread, NULL, 0); }

/* Factorise the matrix whose entries `a` begins with; the plan lies in `iw` behind the header and takes `planned`
 * integers. Returns 0 or one of the failures.
 *
 * IPOPT wants one negative eigenvalue for each multiplier, and regularises and asks again where there are more. That can
 * be known early. More negative pivots than there are multipliers of the constraints that hold an eliminated variable,
 * in the stages so far and behind them, mean a direction of negative curvature in which only eliminated variables move
 * and all constraints hold: the whole has too many whatever comes after (Haynsworth 1968). That some of the stages' unknowns were delayed changes nothing: a variable that waits does not
 * move, a multiplier that waits only adds to the negative ones (Cauchy). Then the rest is left out, and INFO(15) is one
 * too many; IPOPT does not solve with factors of the wrong inertia. */
static int factorise(const Plan *plan, int planned, int room, double threshold, int threads, double *a, int *iw,
                     int *negative) {
  const Space space = space_for(plan, planned, room, threads);
  const int branches = plan->chains - 1;
  Factorisation f = {.plan = plan, .room = room, .threshold = threshold, .a = a, .iw = iw};
  f.largest_remainder = space.remainder;
  f.thread_reals = a + plan->nz;
  f.remainder_reals = f.thread_reals + (size_t)space.threads * (size_t)thread_reals(plan);
  f.thread_integers = iw + HEADER + planned;
  f.remainder_integers = f.thread_integers + (size_t)space.threads * (size_t)thread_integers(plan);
  f.table = f.remainder_integers + branches * space.remainder;
  iw[STAGE_COUNT] = plan->stages, iw[CHAIN_COUNT] = plan->chains, iw[THREADS] = threads;
  iw[TABLE] = (int)(f.table - iw), iw[SIZE] = plan->size;
  /* Every chain's factors have their room from the start. */
  int integers = iw[TABLE] + 2 * plan->stages;
  int reals = (int)(f.remainder_reals - a) + branches * space.remainder * space.remainder;
  for (int s = 0; s < plan->stages; s++) {
    const Space stage = stage_space(plan, s, room);
    f.table[2 * s] = integers, f.table[2 * s + 1] = reals;
    integers += (int)stage.integers, reals += (int)stage.reals;
  }

  f.remainders = malloc(sizeof(Remainder) * (size_t)plan->chains);
  if (!f.remainders) return SINGULAR;
  for_each(branches, space.threads, eliminate_branch, &f);
  if (!f.crowded) eliminate_chain(&f, branches, 0, f.remainders, branches);
  free(f.remainders);
  *negative = f.indefinite ? plan->n - plan->first_multiplier + 1 : f.negative;
  return f.crowded ? NO_REAL_SPACE : f.singular ? SINGULAR : 0;
}

/* ---- the solution ----
 *
 * x goes by place, `local` by the slots of a stage, `dense` by the rows of its panel. */

/* A solve under way; every thread has its own `local` and `dense`. */
typedef struct {
  const Plan *plan;
  const int *iw;
  const double *a, *rhs;
  double *x, *locals;
} Solve;

static int local_reals(const int *iw) { return 2 * column_stride(iw[SIZE]); }

/* Where the factors of a stage are. */
typedef struct {
  const int *header, *table, *places, *origins, *kinds;
  const double *diagonal, *panel;
  int stride, size;
} Stage;

static Stage stage_at(const Solve *solve, int s) {
  const int *iw = solve->iw, *header = iw + iw[iw[TABLE] + 2 * s];
  return (Stage){header, header + STAGE_HEADER, iw + header[PLACES], iw + header[ORIGINS], iw + header[KINDS],
                 solve->a + header[DIAGONAL], solve->a + header[PANEL], panel_stride(header[ROWS]), iw[SIZE]};
}

/* The factors of a pair. */
typedef struct {
  int count_b, count_a;
  const int *rows_b, *rows_a;
  const double *pivot, *b, *a;
} Pair;

static Pair pair_at(const Solve *solve, const Stage *stage, int k) {
  const int *list = solve->iw + stage->table[k], *rows = list + LIST_HEADER;
  const int count_b = list[ROWS_OF_VARIABLE], count_a = list[ROWS_OF_CONSTRAINT];
  const double *pivot = solve->a + stage->table[k + 1];
  return (Pair){count_b, count_a, rows, rows + count_b, pivot, pivot + 3, pivot + 3 + count_b};
}

static void gather(const Stage *stage, const double *x, double *local) {
  const int *header = stage->header, *places = stage->places - header[GATHERED];
  memcpy(local, x + header[FIRST], sizeof(double) * (size_t)header[PAIRED]);
  for (int i = header[GATHERED]; i < stage->size; i++) local[i] = x[places[i]];
}

static void scatter(const Stage *stage, const double *local, double *x) {
  const int *header = stage->header, *places = stage->places - header[GATHERED];
  memcpy(x + header[FIRST], local, sizeof(double) * (size_t)header[PAIRED]);
  for (int i = header[GATHERED]; i < stage->size; i++) x[places[i]] = local[i];
}

/* Forward through the stages of a chain: x loses what the eliminated unknowns carry. */
static void solve_forward(const Solve *solve, int chain, double *local) {
  double *dense = local + column_stride(solve->iw[SIZE]);
  for (int s = solve->plan->chain[chain]; s < chain_end(solve->plan, chain); s++) {
    const Stage stage = stage_at(solve, s);
    const int rows = stage.header[ROWS], columns = stage.header[COLUMNS];
    gather(&stage, solve->x, local);
    for (int k = 0; k < 2 * stage.header[PAIRS]; k += 2) {
      const Pair pair = pair_at(solve, &stage, k);
      const double *pivot = pair.pivot;
      const double u = pivot[0] * local[k] + pivot[1] * local[k + 1], v = pivot[1] * local[k] + pivot[2] * local[k + 1];
      for (int t = 0; t < pair.count_b; t++) local[pair.rows_b[t]] -= pair.b[t] * u;
      for (int t = 0; t < pair.count_a; t++) local[pair.rows_a[t]] -= pair.a[t] * v;
    }
    for (int i = 0; i < rows; i++) dense[i] = local[stage.origins[i]];
    for (int p = 0; p < columns; p++) {
      const int from = p / LANES * LANES; /* the panel is zero from there to its diagonal */
      subtract(dense + from, dense[p], stage.panel + (size_t)p * (size_t)stage.stride + from, padded(rows) - from);
    }
    for (int i = 0; i < rows; i++) local[stage.origins[i]] = dense[i];
    scatter(&stage, local, solve->x);
  }
}

/* Backward: x becomes the solution. */
static void solve_backward(const Solve *solve, int chain, double *local) {
  double *dense = local + column_stride(solve->iw[SIZE]);
  for (int s = chain_end(solve->plan, chain) - 1; s >= solve->plan->chain[chain]; s--) {
    const Stage stage = stage_at(solve, s);
    const int rows = stage.header[ROWS], columns = stage.header[COLUMNS];
    gather(&stage, solve->x, local);
    for (int i = 0; i < rows; i++) dense[i] = local[stage.origins[i]];
    for (int p = 0; p < columns; p++) {
      const double *D = stage.diagonal + 2 * p, u = dense[p], v = dense[p + 1];
      dense[p] = D[0] * u;
      if (stage.kinds[p] == 1) continue;
      dense[p] += D[1] * v;
      dense[++p] = D[1] * u + D[2] * v;
    }
    for (int p = columns - 1; p >= 0; p--) {
      const int from = p / LANES * LANES;
      dense[p] -= dot(dense + from, stage.panel + (size_t)p * (size_t)stage.stride + from, padded(rows) - from);
    }
    for (int i = 0; i < columns; i++) local[stage.origins[i]] = dense[i];
    for (int k = 2 * stage.header[PAIRS] - 2; k >= 0; k -= 2) {
      const Pair pair = pair_at(solve, &stage, k);
      const double *pivot = pair.pivot;
      double u = local[k], v = local[k + 1];
      for (int t = 0; t < pair.count_b; t++) u -= pair.b[t] * local[pair.rows_b[t]];
      for (int t = 0; t < pair.count_a; t++) v -= pair.a[t] * local[pair.rows_a[t]];
      local[k] = pivot[0] * u + pivot[1] * v;
      local[k + 1] = pivot[1] * u + pivot[2] * v;
    }
    scatter(&stage, local, solve->x);
  }
}

static double *local_of(const Solve *solve, int thread) {
  return solve->locals + (size_t)thread * (size_t)local_reals(solve->iw);
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
  solve_forward(solve, chain, local_of(solve, thread));
}

static void backward_branch(void *context, int chain, int thread) {
  const Solve *solve = context;
  const Plan *plan = solve->plan;
  const int trunk_size = plan->n - trunk_position(plan);
  memcpy(solve->x + trunk_places(plan, chain), solve->x + own_places(plan, plan->chains - 1),
         sizeof(double) * (size_t)trunk_size);
  solve_backward(solve, chain, local_of(solve, thread));
}

/* Solve with the factors; `w` has room for x and the threads' locals. */
static void solve_all(int n, const int *iw, const double *a, double *rhs, double *w) {
  const Plan bare = bare_plan(n, 0, iw[STAGE_COUNT], iw[CHAIN_COUNT], iw + HEADER), *plan = &bare;
  const int threads = iw[THREADS];
  Solve solve = {plan, iw, a, rhs, w, w + all_places(plan)};
  memset(solve.locals, 0, sizeof(double) * (size_t)threads * (size_t)local_reals(iw));
  const int branches = plan->chains - 1, trunk = trunk_position(plan);
  double *x = w + own_places(plan, branches);
  for_each(branches, threads, forward_branch, &solve);
  load(&solve, branches);
  for (int c = 0; c < branches; c++) {
    const double *taken = w + trunk_places(plan, c);
    for (int i = 0; i < plan->n - trunk; i++) x[i] += taken[i];
  }
  solve_forward(&solve, branches, solve.locals);
  solve_backward(&solve, branches, solve.locals);
  for_each(branches, threads, backward_branch, &solve);
  for (int c = 0; c < plan->chains; c++) {
    const int first = plan->first[plan->chain[c]], end = plan->first[chain_end(plan, c)];
    const double *own = w + own_places(plan, c);
    for (int p = first; p < end; p++) rhs[plan->order[p]] = own[p - first];
  }
}

/* ---- the calling sequence of MA27 ----
 *
 * IKEEP (3n integers) carries the order of elimination from the analysis to the factorisations, with what else there is
 * to know in front of it. `iw` and `a` are allocated in between, so the plan is made again by the first factorisation
 * and kept in `iw`. */

enum { PLANNED = THREADS + 1, ROOM, PLAN_LENGTH, MULTIPLIERS, KEPT };

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
  (void)iw, (void)liw, (void)iw1, (void)iflag, (void)icntl, (void)cntl;
  memset(info, 0, 20 * sizeof(int));
  *nsteps = 1, *ops = 0;
  const int kept = handed_size(*n, handed.stages, handed.chains);
  if (handed.n != *n || KEPT + kept > 3 * *n) {
    handed.refused++;
    info[0] = FAILED_SIZE;
    return;
  }
  ikeep[PLANNED] = 0, ikeep[STAGE_COUNT] = handed.stages, ikeep[CHAIN_COUNT] = handed.chains;
  ikeep[THREADS] = handed.threads, ikeep[MULTIPLIERS] = handed.first_multiplier;
  memcpy(ikeep + KEPT, handed.order, sizeof(int) * (size_t)kept);
  int length = TOO_SMALL;
  for (int most = 4 * (*n + *nz); length == TOO_SMALL; most *= 2) {
    Plan plan = kept_plan(*n, *nz, ikeep);
    int *room = malloc(sizeof(int) * (size_t)most);
    length = room ? make_plan(&plan, irn, icn, DELAYED_ROOM, room, most) : NO_MEMORY;
    if (length >= 0) {
      ikeep[PLAN_LENGTH] = length + *n; /* it may say that it is too small for want of so much */
      ikeep[ROOM] = DELAYED_ROOM;
      Space space = space_for(&plan, ikeep[PLAN_LENGTH], ikeep[ROOM], handed.threads);
      while (!countable(space, 1) && ikeep[ROOM] > LEAST_DELAYED_ROOM)
        space = space_for(&plan, ikeep[PLAN_LENGTH], ikeep[ROOM] /= 2, handed.threads);
      if (countable(space, 1))
        info[4] = (int)space.reals, info[5] = (int)space.integers;
      else
        handed.refused++, info[0] = FAILED_SIZE;
    }
    free(room);
  }
  if (length == NO_MEMORY) info[0] = NO_INTEGER_SPACE;
}

/* Make the plan in `iw`, with as much room for delayed candidates as the caller's arrays have. Returns 0, or which
 * array is too small, and in `*needed` the size that it should have. */
static int plan_for(Plan *plan, const int *irn, const int *icn, int *ikeep, int real_space, int *iw, int integer_space,
                    int *needed) {
  const Plan bare = *plan;
  const int planned = ikeep[PLAN_LENGTH], threads = ikeep[THREADS];
  int room = ikeep[ROOM];
  if (HEADER + planned > integer_space) return *needed = 2 * (HEADER + planned), NO_INTEGER_SPACE;
  if (make_plan(plan, irn, icn, room, iw + HEADER, planned) < 0) return handed.refused++, FAILED_SIZE;
  Space space = space_for(plan, planned, room, threads);
  for (;;) {
    const Space more = space_for(plan, planned, 2 * room, threads);
    if (more.reals > real_space || more.integers > integer_space) break;
    space = more, room *= 2;
  }
  if (space.reals > real_space) return *needed = (int)space.reals, NO_REAL_SPACE;
  if (space.integers > integer_space) return *needed = (int)space.integers, NO_INTEGER_SPACE;
  *plan = bare;
  if (room > ikeep[ROOM] && make_plan(plan, irn, icn, room, iw + HEADER, planned) < 0)
    return handed.refused++, FAILED_SIZE;
  ikeep[ROOM] = room;
  return 0;
}

/* Factorisation: INFO(1) as MA27 says it, INFO(15) the number of negative eigenvalues. */
void ma27bd_(int *n, int *nz, const int *irn, const int *icn, double *a, int *la, int *iw, int *liw, int *ikeep,
             int *nsteps, int *maxfrt, int *iw1, int *icntl, double *cntl, int *info) {
  (void)nsteps, (void)iw1, (void)icntl;
  memset(info, 0, 20 * sizeof(int));
  Plan plan = kept_plan(*n, *nz, ikeep);
  if (!ikeep[PLANNED]) info[0] = plan_for(&plan, irn, icn, ikeep, *la, iw, *liw, &info[1]);
  if (info[0]) return;
  read_plan(&plan, ikeep[ROOM], iw + HEADER);
  plan.first_multiplier = ikeep[MULTIPLIERS];
  info[0] = factorise(&plan, ikeep[PLAN_LENGTH], ikeep[ROOM], cntl[0], ikeep[THREADS], a, iw, &info[14]);
  if (info[0] == NO_REAL_SPACE) {
    const Space more = space_for(&plan, ikeep[PLAN_LENGTH], 2 * ikeep[ROOM], ikeep[THREADS]);
    if (countable(more, 2)) /* IPOPT takes twice of what is asked for */
      info[1] = (int)more.reals;
    else
      handed.refused++, info[0] = FAILED_SIZE;
  }
  ikeep[PLANNED] = info[0] != NO_REAL_SPACE; /* else both arrays are allocated anew, and the plan is lost with them */
  *maxfrt = all_places(&plan) + ikeep[THREADS] * local_reals(iw);
}

void ma27cd_(int *n, double *a, int *la, int *iw, int *liw, double *w, int *maxfrt, double *rhs, int *iw1,
             int *nsteps, int *icntl, double *cntl) {
  (void)la, (void)liw, (void)maxfrt, (void)iw1, (void)nsteps, (void)icntl, (void)cntl;
  solve_all(*n, iw, a, rhs, w);
}
