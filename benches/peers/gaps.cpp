#include "analytic.hpp"

void gaps_and_rows(const Touch* touches, int count, const SetUp& set_up, const double* g, const double* b,
                   int n_globals, double weight, double* gaps, double* by_globals, double* by_set_up) {
  const Angles angles(g, b);
  double dg[12], db[6];
  for (int i = 0; i < count; ++i) {
    gaps[i] = weight * gap_and_row(touches[i], set_up, g, b, angles, n_globals, dg, db);
    if (by_globals)
      for (int k = 0; k < n_globals; ++k) by_globals[i * n_globals + k] = weight * dg[k];
    if (by_set_up)
      for (int k = 0; k < 6; ++k) by_set_up[i * 6 + k] = weight * db[k];
  }
}
