// Analytic derivatives of the gap. No Eigen in here: gaps.cpp is compiled for this very processor, which Eigen's types must
// not be where they meet the packaged Ceres.
#pragma once
#include "problem.hpp"

// Sines and cosines of all error angles: one set for all touches of a set-up.
struct Angles {
  double sa0, ca0, sc0, cc0, sa, ca, se, ce, s[3], c[3];
  Angles(const double* g, const double* b)
      : sa0(std::sin(g[2] * kDeg)), ca0(std::cos(g[2] * kDeg)), sc0(std::sin(g[3] * kDeg)), cc0(std::cos(g[3] * kDeg)),
        sa(std::sin(g[6] * kDeg)), ca(std::cos(g[6] * kDeg)), se(std::sin(g[7] * kDeg)), ce(std::cos(g[7] * kDeg)) {
    for (int k = 0; k < 3; ++k) s[k] = std::sin(b[3 + k] * kDeg), c[k] = std::cos(b[3 + k] * kDeg);
  }
};

// The gap with its derivatives: `dg` by the globals, `db` by the six of the set-up (mm per unit).
inline double gap_and_row(const Touch& t, const SetUp& s, const double* g, const double* b, const Angles& a,
                          int n_globals, double* dg, double* db) {
  // forward, remembering the point in front of each rotation
  double u[3] = {t.ball[0] + g[0], t.ball[1], t.ball[2] + g[1]};
  turn(u[2], u[0], t.sb, t.cb);
  double v[3] = {u[0], u[1], u[2]};
  turn(v[1], v[2], a.sa0, a.ca0);
  const double x1[3] = {v[0], v[1], v[2]};
  turn(v[0], v[1], a.sc0, a.cc0);
  const double x2[3] = {v[0], v[1], v[2]};
  // a late trigger has let the axes go on against the planned normal
  double r[3] = {t.normal[0], t.normal[1], t.normal[2]};
  if (s.turns) turn(r[0], r[1], t.sc, t.cc);
  v[0] += t.x + g[8] * r[0], v[1] += t.y + g[8] * r[1], v[2] += t.z + g[8] * r[2];
  if (n_globals == 12) {
    v[0] -= kMicro * (g[9] * t.x - g[11] * t.y);
    v[1] -= kMicro * g[10] * t.y;
  }
  double y1[3], y2[3];  // behind Ry back, behind Rx back
  if (s.turns) {
    v[0] -= g[4], v[1] -= g[5];
    turn(v[2], v[0], -a.se, a.ce);
    std::memcpy(y1, v, sizeof v);
    turn(v[1], v[2], -a.sa, a.ca);
    std::memcpy(y2, v, sizeof v);
    turn(v[0], v[1], -t.sc, t.cc);
  }
  for (int k = 0; k < 3; ++k) v[k] -= s.centre[k] + b[k];
  turn(v[0], v[1], -a.s[2], a.c[2]);
  const double z1[3] = {v[0], v[1], v[2]};
  turn(v[2], v[0], -a.s[1], a.c[1]);
  const double z2[3] = {v[0], v[1], v[2]};
  turn(v[1], v[2], -a.s[0], a.c[0]);
  double out = -t.radius;
  for (int k = 0; k < 3; ++k) out += t.normal[k] * (v[k] + s.centre[k] - t.point[k]);

  // backward: h = d gap / d point. d(R(-w) p)/dw = -axis x (R(-w) p); the component of a cross product is its slope.
  double h[3] = {t.normal[0], t.normal[1], t.normal[2]};
  db[3] = -kDeg * (h[2] * v[1] - h[1] * v[2]);
  turn(h[1], h[2], a.s[0], a.c[0]);
  db[4] = -kDeg * (h[0] * z2[2] - h[2] * z2[0]);
  turn(h[2], h[0], a.s[1], a.c[1]);
  db[5] = -kDeg * (h[1] * z1[0] - h[0] * z1[1]);
  turn(h[0], h[1], a.s[2], a.c[2]);
  for (int k = 0; k < 3; ++k) db[k] = -h[k];
  if (s.turns) {
    turn(h[0], h[1], t.sc, t.cc);
    dg[6] = -kDeg * (h[2] * y2[1] - h[1] * y2[2]);
    turn(h[1], h[2], a.sa, a.ca);
    dg[7] = -kDeg * (h[0] * y1[2] - h[2] * y1[0]);
    turn(h[2], h[0], a.se, a.ce);
    dg[4] = -h[0], dg[5] = -h[1];
  } else {
    dg[4] = dg[5] = dg[6] = dg[7] = 0.0;
  }
  dg[8] = h[0] * r[0] + h[1] * r[1] + h[2] * r[2];
  if (n_globals == 12) {
    dg[9] = -kMicro * t.x * h[0];
    dg[10] = -kMicro * t.y * h[1];
    dg[11] = kMicro * t.y * h[0];
  }
  dg[3] = kDeg * (h[1] * x2[0] - h[0] * x2[1]);
  turn(h[0], h[1], -a.sc0, a.cc0);
  dg[2] = kDeg * (h[2] * x1[1] - h[1] * x1[2]);
  turn(h[1], h[2], -a.sa0, a.ca0);
  turn(h[2], h[0], -t.sb, t.cb);
  dg[0] = h[0], dg[1] = h[2];
  return out;
}
