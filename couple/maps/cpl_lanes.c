/*
 * Sparse rows of weights on eight lanes: three displacements and a zero, three rotations and a zero.
 * The Fortran compiler takes such loops one number at a time. GCC's vector types become the machine's
 * own registers, whatever it has. Indices are those of Fortran, from 1; row i has the entries
 * first[i] to first[i + 1] - 1 (cpl_rows.f90). `row` names the rows, all of them in turn if it is null.
 */
#pragma GCC optimize("fp-contract=fast") /* products and sums in one, as Fortran has them */
#include <stddef.h>
#include <stdint.h>
#include <string.h>

enum { HALF = 4, LANES = 8, AXES = 3 };

typedef double lanes_type __attribute__((vector_size(LANES * sizeof(double))));

static inline lanes_type load(const double *from)
{
    lanes_type lanes;
    memcpy(&lanes, from, sizeof lanes);
    return lanes;
}

static inline void store(double *to, lanes_type lanes) { memcpy(to, &lanes, sizeof lanes); }

void cpl_sum_rows(int32_t rows, const int32_t *row, const int32_t *first, const int32_t *at, const double *weight,
                  const double *x, double *y, double *z);
void cpl_add_rows(int32_t rows, const int32_t *row, const int32_t *first, const int32_t *at, const double *weight,
                  const double *y, const double *z, double *x);

/* Values at the rows: three lanes each to y and z. Two sums, so that none waits for the other. */
void cpl_sum_rows(int32_t rows, const int32_t *row, const int32_t *first, const int32_t *at, const double *weight,
                  const double *x, double *y, double *z)
{
    for (int32_t k = 0; k < rows; k++) {
        const int32_t i = row == NULL ? k : row[k] - 1;
        const int32_t end = first[i + 1] - 1;
        lanes_type s = {0}, t = {0};
        int32_t e = first[i] - 1;
        for (; e < end - 1; e += 2) {
            s += weight[e] * load(x + (int64_t)(at[e] - 1) * LANES);
            t += weight[e + 1] * load(x + (int64_t)(at[e + 1] - 1) * LANES);
        }
        if (e < end) s += weight[e] * load(x + (int64_t)(at[e] - 1) * LANES);
        s += t;
        for (int l = 0; l < AXES; l++) {
            y[(int64_t)k * AXES + l] = s[l];
            z[(int64_t)k * AXES + l] = s[HALF + l];
        }
    }
}

/* The transpose: values at the rows, added to the columns. */
void cpl_add_rows(int32_t rows, const int32_t *row, const int32_t *first, const int32_t *at, const double *weight,
                  const double *y, const double *z, double *x)
{
    for (int32_t k = 0; k < rows; k++) {
        const int32_t i = row == NULL ? k : row[k] - 1;
        const double *a = y + (int64_t)k * AXES, *b = z + (int64_t)k * AXES;
        const lanes_type f = {a[0], a[1], a[2], 0.0, b[0], b[1], b[2], 0.0};
        if (a[0] == 0.0 && a[1] == 0.0 && a[2] == 0.0 && b[0] == 0.0 && b[1] == 0.0 && b[2] == 0.0)
            continue; /* ghosts that nothing touches */
        for (int32_t e = first[i] - 1; e < first[i + 1] - 1; e++) {
            double *to = x + (int64_t)(at[e] - 1) * LANES;
            store(to, load(to) + weight[e] * f);
        }
    }
}
