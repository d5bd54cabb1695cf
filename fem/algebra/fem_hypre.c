/* A distributed matrix, its algebraic multigrid and the Krylov methods that it preconditions, by hypre
 * (2.26 or newer, 32-bit numbers, with MPI). hypre's handles, types of MPI and callbacks stay here.
 *
 * The unknowns are coarsened component by component ("unknown approach"), with aggressive coarsening on the
 * first level. Symmetric systems are smoothed by Chebyshev polynomials, others by symmetric Gauss-Seidel
 * with row sums.
 *
 * Sources: Henson and Yang 2002 (https://doi.org/10.1016/S0168-9274(01)00115-5); Baker, Kolev and Yang 2010
 * (https://doi.org/10.1002/nla.688). */
#include <math.h>
#include <stdlib.h>

#include <HYPRE.h>
#include <HYPRE_IJ_mv.h>
#include <HYPRE_krylov.h>
#include <HYPRE_parcsr_ls.h>
#include <mpi.h>

enum { hmis = 10, extended_i = 6, two_stage_extended = 7, per_row = 4 };
enum { chebyshev = 16, symmetric_gauss_seidel = 8, basis = 100, fault = -1 };
static const double strong = 0.5;  /* connections, over the strongest of a row */

typedef struct {
    MPI_Comm comm;
    int first, rows;
    int *row;  /* numbers of this rank's rows */
    int symmetric;
    HYPRE_IJMatrix matrix;
    HYPRE_IJVector right, x;
    HYPRE_Solver amg;
} hypre_system;

void *talus_hypre_new(int comm, int first, int rows, const int *room);
int talus_hypre_add(void *system, int rows, int *counts, const int *row, const int *column,
                    const double *value);
int talus_hypre_set_up(void *system, int functions, const int *function, int symmetric);
int talus_hypre_solve(void *system, int gradients, double tolerance, int most, const double *right,
                      double *x, double *residual);
void talus_hypre_free(void *system);

static void make_vector(const hypre_system *s, HYPRE_IJVector *vector)
{
    HYPRE_IJVectorCreate(s->comm, s->first, s->first + s->rows - 1, vector);
    HYPRE_IJVectorSetObjectType(*vector, HYPRE_PARCSR);
    HYPRE_IJVectorInitialize(*vector);
}

/* A matrix of which this rank has the rows from `first` (0 is the first of all); `room` is a guess of the
   entries in each. NULL: no memory. */
void *talus_hypre_new(int comm, int first, int rows, const int *room)
{
    hypre_system *s = calloc(1, sizeof *s);
    if (s == NULL) return NULL;
    s->row = malloc(((size_t)rows + 1) * sizeof *s->row);
    if (s->row == NULL) {
        free(s);
        return NULL;
    }
    for (int i = 0; i < rows; i++)
        s->row[i] = first + i;
    HYPRE_Init();
    HYPRE_ClearAllErrors();
    s->comm = MPI_Comm_f2c(comm);
    s->first = first;
    s->rows = rows;
    HYPRE_IJMatrixCreate(s->comm, first, first + rows - 1, first, first + rows - 1, &s->matrix);
    HYPRE_IJMatrixSetObjectType(s->matrix, HYPRE_PARCSR);
    HYPRE_IJMatrixSetRowSizes(s->matrix, room);
    HYPRE_IJMatrixInitialize(s->matrix);
    make_vector(s, &s->right);
    make_vector(s, &s->x);
    return s;
}

/* Add to rows, of other ranks too. */
int talus_hypre_add(void *system, int rows, int *counts, const int *row, const int *column,
                    const double *value)
{
    hypre_system *s = system;
    return HYPRE_IJMatrixAddToValues(s->matrix, rows, counts, row, column, value);
}

/* The hierarchy, once all entries are there; function[i] is the component of this rank's row i. */
int talus_hypre_set_up(void *system, int functions, const int *function, int symmetric)
{
    hypre_system *s = system;
    void *matrix, *right, *x;
    int *of_row = malloc(((size_t)s->rows + 1) * sizeof *of_row);  /* hypre frees it */
    if (of_row == NULL) return HYPRE_ERROR_MEMORY;
    for (int i = 0; i < s->rows; i++)
        of_row[i] = function[i];
    s->symmetric = symmetric;
    HYPRE_IJMatrixAssemble(s->matrix);
    HYPRE_IJVectorAssemble(s->right);
    HYPRE_IJVectorAssemble(s->x);
    HYPRE_IJMatrixGetObject(s->matrix, &matrix);
    HYPRE_IJVectorGetObject(s->right, &right);
    HYPRE_IJVectorGetObject(s->x, &x);
    HYPRE_BoomerAMGCreate(&s->amg);
    HYPRE_BoomerAMGSetMaxIter(s->amg, 1);
    HYPRE_BoomerAMGSetTol(s->amg, 0.0);
    HYPRE_BoomerAMGSetNumFunctions(s->amg, functions);
    HYPRE_BoomerAMGSetDofFunc(s->amg, of_row);
    HYPRE_BoomerAMGSetCoarsenType(s->amg, hmis);
    HYPRE_BoomerAMGSetInterpType(s->amg, extended_i);
    HYPRE_BoomerAMGSetPMaxElmts(s->amg, per_row);
    HYPRE_BoomerAMGSetStrongThreshold(s->amg, strong);
    HYPRE_BoomerAMGSetAggNumLevels(s->amg, 1);
    HYPRE_BoomerAMGSetAggInterpType(s->amg, two_stage_extended);
    HYPRE_BoomerAMGSetRelaxType(s->amg, symmetric ? chebyshev : symmetric_gauss_seidel);
    HYPRE_BoomerAMGSetup(s->amg, matrix, right, x);
    return HYPRE_GetError();
}

/* The hierarchy is there before a Krylov method is. */
static HYPRE_Int ready(HYPRE_Solver amg, HYPRE_Matrix matrix, HYPRE_Vector right, HYPRE_Vector x)
{
    (void)amg, (void)matrix, (void)right, (void)x;
    return 0;
}

static HYPRE_Int one_cycle(HYPRE_Solver amg, HYPRE_Matrix matrix, HYPRE_Vector right, HYPRE_Vector x)
{
    return HYPRE_BoomerAMGSolve(amg, (HYPRE_ParCSRMatrix)matrix, (HYPRE_ParVector)right,
                                (HYPRE_ParVector)x);
}

static int by_gradients(hypre_system *s, double tolerance, int most, void *const *object,
                        double *residual)
{
    HYPRE_Solver krylov;
    int iterations = 0;
    HYPRE_ParCSRPCGCreate(s->comm, &krylov);
    HYPRE_PCGSetTol(krylov, tolerance);
    HYPRE_PCGSetMaxIter(krylov, most);
    HYPRE_PCGSetTwoNorm(krylov, 1);
    HYPRE_PCGSetPrecond(krylov, one_cycle, ready, s->amg);
    HYPRE_PCGSetup(krylov, object[0], object[1], object[2]);
    HYPRE_PCGSolve(krylov, object[0], object[1], object[2]);
    HYPRE_PCGGetNumIterations(krylov, &iterations);
    HYPRE_PCGGetFinalRelativeResidualNorm(krylov, residual);
    HYPRE_ParCSRPCGDestroy(krylov);
    return iterations;
}

static int by_residuals(hypre_system *s, double tolerance, int most, void *const *object,
                        double *residual)
{
    HYPRE_Solver krylov;
    int iterations = 0;
    HYPRE_ParCSRGMRESCreate(s->comm, &krylov);
    HYPRE_GMRESSetTol(krylov, tolerance);
    HYPRE_GMRESSetMaxIter(krylov, most);
    HYPRE_GMRESSetKDim(krylov, basis);
    HYPRE_GMRESSetPrecond(krylov, one_cycle, ready, s->amg);
    HYPRE_GMRESSetup(krylov, object[0], object[1], object[2]);
    HYPRE_GMRESSolve(krylov, object[0], object[1], object[2]);
    HYPRE_GMRESGetNumIterations(krylov, &iterations);
    HYPRE_GMRESGetFinalRelativeResidualNorm(krylov, residual);
    HYPRE_ParCSRGMRESDestroy(krylov);
    return iterations;
}

/* This rank's rows of the solution, from zero, by conjugate gradients or by least residuals (GMRES). residual[0] is
   that of the method over the right-hand side; residual[1] is the norm of the true one: gradients that break down
   report none. Returns the iterations, or a negative number for a fault of hypre. */
int talus_hypre_solve(void *system, int gradients, double tolerance, int most, const double *right,
                      double *x, double *residual)
{
    hypre_system *s = system;
    void *object[3];
    int iterations;
    double square = 1.0;
    for (int i = 0; i < s->rows; i++)
        x[i] = 0.0;
    residual[0] = 1.0;
    HYPRE_ClearAllErrors();
    HYPRE_IJVectorSetValues(s->right, s->rows, s->row, right);
    HYPRE_IJVectorSetValues(s->x, s->rows, s->row, x);
    HYPRE_IJVectorAssemble(s->right);
    HYPRE_IJVectorAssemble(s->x);
    HYPRE_IJMatrixGetObject(s->matrix, &object[0]);
    HYPRE_IJVectorGetObject(s->right, &object[1]);
    HYPRE_IJVectorGetObject(s->x, &object[2]);
    iterations = gradients ? by_gradients(s, tolerance, most, object, residual)
                           : by_residuals(s, tolerance, most, object, residual);
    HYPRE_IJVectorGetValues(s->x, s->rows, s->row, x);
    HYPRE_ParCSRMatrixMatvec(-1.0, object[0], object[2], 1.0, object[1]);
    HYPRE_ParVectorInnerProd(object[1], object[1], &square);
    residual[1] = sqrt(square);
    HYPRE_ClearError(HYPRE_ERROR_CONV);
    return HYPRE_GetError() ? fault : iterations;
}

void talus_hypre_free(void *system)
{
    hypre_system *s = system;
    if (s == NULL) return;
    if (s->amg) HYPRE_BoomerAMGDestroy(s->amg);
    HYPRE_IJMatrixDestroy(s->matrix);
    HYPRE_IJVectorDestroy(s->right);
    HYPRE_IJVectorDestroy(s->x);
    free(s->row);
    free(s);
}
