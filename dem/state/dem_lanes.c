/*
 * Records to lanes and back: the turning of 8 x 8 squares of reals that the Fortran compiler does one
 * number at a time. GCC's vector types become the machine's own registers, whatever it has.
 *
 * The loops over a square must be unrolled, or it would live in memory and not in registers.
 * A body record is 16 reals, a result record 8; a block has LANES lanes, one short array a quantity
 * (dem_block.f90: dem_side_type, dem_load_type). Indices are those of Fortran, from 1.
 */
#include <stdint.h>
#include <string.h>
#ifdef __AVX512F__
#include <immintrin.h>
#endif

enum { LANES = 16, WIDTH = 8, QUAT = 4, BODY = 16, MOTION = 9, RESULT = 8, LOADS = 6, AHEAD = 48 };

typedef double row_type __attribute__((vector_size(WIDTH * sizeof(double))));
typedef int64_t pick_type __attribute__((vector_size(WIDTH * sizeof(int64_t))));
typedef double quad_type __attribute__((vector_size(QUAT * sizeof(double))));
typedef int64_t quad_pick_type __attribute__((vector_size(QUAT * sizeof(int64_t))));

static inline row_type load(const double *from)
{
    row_type row;
    memcpy(&row, from, sizeof row);
    return row;
}

static inline void store(double *to, row_type row) { memcpy(to, &row, sizeof row); }

/* Turn a square: column i of the result is row i of the input. */
static inline void turn(row_type m[WIDTH])
{
    const pick_type low1 = {0, 8, 2, 10, 4, 12, 6, 14}, high1 = {1, 9, 3, 11, 5, 13, 7, 15};
    const pick_type low2 = {0, 1, 8, 9, 4, 5, 12, 13}, high2 = {2, 3, 10, 11, 6, 7, 14, 15};
    const pick_type low4 = {0, 1, 2, 3, 8, 9, 10, 11}, high4 = {4, 5, 6, 7, 12, 13, 14, 15};
    row_type a[WIDTH], b[WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i += 2) {
        a[i] = __builtin_shuffle(m[i], m[i + 1], low1);
        a[i + 1] = __builtin_shuffle(m[i], m[i + 1], high1);
    }
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i += 4) {
#pragma GCC unroll 8
        for (int j = 0; j < 2; j++) {
            b[i + j] = __builtin_shuffle(a[i + j], a[i + j + 2], low2);
            b[i + j + 2] = __builtin_shuffle(a[i + j], a[i + j + 2], high2);
        }
    }
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH / 2; i++) {
        m[i] = __builtin_shuffle(b[i], b[i + 4], low4);
        m[i + 4] = __builtin_shuffle(b[i], b[i + 4], high4);
    }
}

/*
 * Read a piece of memory line by line, from front to back. What follows reads and writes it in leaps,
 * which processors do not see coming; pieces that lie behind each other and are read in order they
 * fetch ahead by themselves. (Prefetch instructions do not teach them: no gain.)
 */
void dem_read_in_order(const double *from, int32_t reals)
{
    double sum = 0;
    for (int32_t k = 0; k < reals; k += WIDTH) sum += from[k];
    __asm__ volatile("" : : "g"(sum));
}

/* Call for a piece of memory that will be wanted soon. */
void dem_call_for(const double *from, int32_t reals)
{
    for (int32_t k = 0; k < reals; k += WIDTH) __builtin_prefetch(from + k);
}

/* Call for the records of bodies that will be wanted soon. Not inlined, this would be a function without
 * effect to the compiler, and calls of it would be left out. */
__attribute__((always_inline)) static inline void call_for(const double *body, const int32_t next[LANES])
{
    for (int k = 0; k < LANES; k++) {
        const double *ahead = body + (int64_t)(next[k] - 1) * BODY;
        __builtin_prefetch(ahead);
        __builtin_prefetch(ahead + WIDTH);
    }
}

/* One half of the records of WIDTH bodies into the lanes from k on. */
__attribute__((always_inline)) static inline void gather_half(const double *body, const int32_t *index, int half, double *side)
{
    row_type m[WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i++) m[i] = load(body + (int64_t)(index[i] - 1) * BODY + half);
    turn(m);
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i++) store(side + (half + i) * LANES, m[i]);
}

/*
 * The records of LANES bodies into lanes, side[BODY][LANES]; those of `next` are called for if they may
 * lie in memory alone.
 */
void dem_gather_side(const double *body, const int32_t index[LANES], const int32_t next[LANES],
                     int32_t far, double *side)
{
    if (far) call_for(body, next);
    for (int k = 0; k < LANES; k += WIDTH) {
        gather_half(body, index + k, 0, side + k);
        gather_half(body, index + k, WIDTH, side + k);
    }
}

/* The same for other records of BODY reals. */
void dem_gather_records(const double *record, const int32_t index[LANES],
                        const int32_t next[LANES], int32_t far, double *side)
{
    dem_gather_side(record, index, next, far, side);
}

/* The same for spheres: of the second half only the last of the spin and the first of the shape. */
void dem_gather_spheres(const double *body, const int32_t index[LANES], const int32_t next[LANES],
                        int32_t far, double *side)
{
    if (far) call_for(body, next);
    for (int k = 0; k < LANES; k += WIDTH) gather_half(body, index + k, 0, side + k);
    for (int k = 0; k < LANES; k++) {
        const double *record = body + (int64_t)(index[k] - 1) * BODY;
        side[(MOTION - 1) * LANES + k] = record[MOTION - 1];
        side[MOTION * LANES + k] = record[MOTION];
    }
}

/* The same, but place, velocity and spin alone: side[MOTION][LANES]. */
void dem_gather_motions(const double *body, const int32_t index[LANES], const int32_t next[LANES],
                        int32_t far, double *side)
{
    if (far) call_for(body, next);
    for (int k = 0; k < LANES; k += WIDTH) {
        row_type last;
        gather_half(body, index + k, 0, side + k);
#pragma GCC unroll 8
        for (int i = 0; i < WIDTH; i++) last[i] = body[(int64_t)(index[k + i] - 1) * BODY + WIDTH];
        store(side + WIDTH * LANES + k, last);
    }
}

/*
 * Orientations of `count` frames that follow each other, frame[][QUAT], in bodies whose quaternions
 * are quat[QUAT][stride], to the first reals of the records of BODY reals of those bodies.
 */
void dem_put_frames(const double *quat, int32_t stride, int32_t count, const double *frame,
                    double *record)
{
    const quad_pick_type second = {1, 0, 3, 2}, third = {2, 3, 0, 1}, fourth = {3, 2, 1, 0};
    const quad_type sign2 = {-1, 1, -1, 1}, sign3 = {-1, 1, 1, -1}, sign4 = {-1, -1, 1, 1};
    for (int k = 0; k < count; k++) {
        quad_type f, q;
        memcpy(&f, frame + QUAT * k, sizeof f);
        q = quat[k] * f;
        q += quat[stride + k] * (sign2 * __builtin_shuffle(f, second));
        q += quat[2 * stride + k] * (sign3 * __builtin_shuffle(f, third));
        q += quat[3 * stride + k] * (sign4 * __builtin_shuffle(f, fourth));
        memcpy(record + BODY * k, &q, sizeof q);
    }
}

/*
 * Store a row; past the caches if it will not be read before they have been filled with other things:
 * the processor need not fetch the line first.
 */
static inline void put(double *to, row_type row, int past)
{
#ifdef __AVX512F__
    if (past && (uintptr_t)to % sizeof row == 0) {
        _mm512_stream_pd(to, (__m512d)row);
        return;
    }
#endif
    (void)past;
    store(to, row);
}

/* All stores past the caches before now are seen by other threads after now. */
void dem_finish_puts(void) { __atomic_thread_fence(__ATOMIC_SEQ_CST); }

/* Loads of the lanes, load[LOADS][LANES], to LANES records that follow each other; spare reals 0. */
void dem_put_loads(const double *load_of, int32_t past, double *result)
{
    for (int k = 0; k < LANES; k += WIDTH) {
        row_type m[WIDTH];
#pragma GCC unroll 8
        for (int i = 0; i < LOADS; i++) m[i] = load(load_of + i * LANES + k);
#pragma GCC unroll 8
        for (int i = LOADS; i < WIDTH; i++) m[i] = (row_type){0};
        turn(m);
#pragma GCC unroll 8
        for (int i = 0; i < WIDTH; i++) put(result + (k + i) * RESULT, m[i], past);
    }
}

/* Lanes to the records of `count` bodies that follow each other. */
void dem_put_bodies(const double *side, int32_t count, double *body)
{
    for (int k = 0; k < count; k += WIDTH) {
        for (int half = 0; half < BODY; half += WIDTH) {
            row_type m[WIDTH];
#pragma GCC unroll 8
            for (int i = 0; i < WIDTH; i++) m[i] = load(side + (half + i) * LANES + k);
            turn(m);
#pragma GCC unroll 8
            for (int i = 0; i < WIDTH; i++) {
                if (k + i < count) store(body + (int64_t)(k + i) * BODY + half, m[i]);
            }
        }
    }
}

/* The same for spheres, whose records change in the first MOTION reals only. */
void dem_put_motions(const double *side, int32_t count, double *body)
{
    for (int k = 0; k < count; k += WIDTH) {
        row_type m[WIDTH];
#pragma GCC unroll 8
        for (int i = 0; i < WIDTH; i++) m[i] = load(side + i * LANES + k);
        turn(m);
        for (int i = 0; i < WIDTH && k + i < count; i++) {
            store(body + (int64_t)(k + i) * BODY, m[i]);
            body[(int64_t)(k + i) * BODY + MOTION - 1] = side[(MOTION - 1) * LANES + k + i];
        }
    }
}

/* Half of the records of `count` <= WIDTH bodies that follow each other into the lanes from side on. */
__attribute__((always_inline)) static inline void take_half(const double *body, int32_t count, double *side)
{
    row_type m[WIDTH];
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i++) m[i] = i < count ? load(body + (int64_t)i * BODY) : (row_type){0};
    turn(m);
#pragma GCC unroll 8
    for (int i = 0; i < WIDTH; i++) store(side + i * LANES, m[i]);
}

/* The records of `count` bodies that follow each other to lanes; the other lanes become zero. */
void dem_take_bodies(const double *body, int32_t count, double *side)
{
    for (int k = 0; k < LANES; k += WIDTH) {
        const double *first = body + (int64_t)k * BODY;
        take_half(first, count - k, side + k);
        take_half(first + WIDTH, count - k, side + WIDTH * LANES + k);
    }
}

/* The same for spheres, of whose records the first MOTION reals are wanted. */
void dem_take_motions(const double *body, int32_t count, double *side)
{
    for (int k = 0; k < LANES; k += WIDTH) take_half(body + (int64_t)k * BODY, count - k, side + k);
    for (int k = 0; k < LANES; k++)
        side[(MOTION - 1) * LANES + k] = k < count ? body[(int64_t)k * BODY + MOTION - 1] : 0;
}

/*
 * What acts on a body: the sum of the results of its pairs in the order of its entries first .. last
 * (from 1, last < first: none). An entry is 2 (slot - 1) + side; side 1 gets the load, side 0 its
 * opposite. The list of entries goes on for AHEAD entries that name slots, so that results can be
 * called for early.
 */
static inline row_type sum_of(const double *result, const int32_t *entry, int64_t first, int64_t last)
{
    row_type sum = {0};
    for (int64_t e = first - 1; e < last; e++) {
        __builtin_prefetch(result + (int64_t)(entry[e + AHEAD] >> 1) * RESULT);
        const row_type row = load(result + (int64_t)(entry[e] >> 1) * RESULT);
        sum += (entry[e] & 1) ? row : -row;
    }
    return sum;
}

/* The sum of one body, moment about the origin: total[RESULT]. */
void dem_sum_results(const double *result, const int32_t *entry, int32_t first, int32_t last,
                     double *total)
{
    store(total, sum_of(result, entry, first, last));
}

/*
 * Forces and moments about their centres x[3][LANES] of `count` bodies that follow each other, the
 * first of them with the entries start[0] .. start[1] - 1: force[3][LANES], moment[3][LANES].
 */
void dem_sum_lanes(const double *result, const int32_t *entry, const int32_t *start, int32_t count,
                   const double *x, double *force, double *moment)
{
    for (int k = 0; k < LANES; k += WIDTH) {
        row_type m[WIDTH];
        for (int i = 0; i < WIDTH; i++) {
            m[i] = (row_type){0};
            if (k + i < count) m[i] = sum_of(result, entry, start[k + i], start[k + i + 1] - 1);
        }
        turn(m);
        const row_type px = load(x + k), py = load(x + LANES + k), pz = load(x + 2 * LANES + k);
        store(force + k, m[0]);
        store(force + LANES + k, m[1]);
        store(force + 2 * LANES + k, m[2]);
        store(moment + k, m[3] - (py * m[2] - pz * m[1]));
        store(moment + LANES + k, m[4] - (pz * m[0] - px * m[2]));
        store(moment + 2 * LANES + k, m[5] - (px * m[1] - py * m[0]));
    }
}
