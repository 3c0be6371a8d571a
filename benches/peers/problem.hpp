// The problem that all peers solve: touches and unknowns as `cargo bench --bench peers` writes them, and the gap at a
// touch with its derivatives. docs/conventions.md fixes signs and frames; README.md beside this file the file format.
#pragma once
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <fstream>
#include <sstream>
#include <stdexcept>
#include <string>
#include <vector>

constexpr double kDeg = M_PI / 180.0;
constexpr double kMicro = 1e-6;

// One touch. Lengths mm, angles rad; point and normal in the carrier's frame.
struct Touch {
  double x, y, z;
  double sb, cb, sc, cc;  // sine and cosine of the rotary axes: the same in every iteration
  double point[3], normal[3];
  double radius;
  double ball[3];
  int set_up;
};

struct SetUp {
  bool turns;  // carried by C, else by the linear axes' table
  double centre[3];
};

// Globals stand first, in this order; then SX SY SZ SA SB SC of each set-up. 9 or 12 of the globals are unknown.
inline const char* const kGlobals[] = {"EX0B", "EZ0B", "EA0B", "EC0B", "EX0C", "EY0C",
                                       "EA0C", "EB0C", "pretravel", "EXX", "EYY", "EC0Y"};
inline const char* const kSetUp[] = {"SX", "SY", "SZ", "SA", "SB", "SC"};

struct Problem {
  std::vector<Touch> touches;  // ordered by set-up
  std::vector<SetUp> set_ups;
  std::vector<std::string> names;
  std::vector<size_t> first;  // first touch of each set-up, and the end
  int globals = 0;
  double sigma = 1.0;  // standard deviation of a touch, mm

  int unknowns() const { return static_cast<int>(names.size()); }

  explicit Problem(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw std::runtime_error("cannot open " + path);
    std::string line, word;
    size_t n = 0, n_set_ups = 0, n_unknowns = 0;
    std::getline(in, line);
    if (line != "axiscal-peers/1") throw std::runtime_error(path + " is no problem file");
    std::getline(in, line);
    std::istringstream(line) >> n >> n_set_ups >> n_unknowns >> sigma;
    for (size_t i = 0; i < n_set_ups; ++i) {
      SetUp s{};
      std::getline(in, line);
      std::istringstream(line) >> word >> s.centre[0] >> s.centre[1] >> s.centre[2];
      s.turns = word == "C";
      set_ups.push_back(s);
    }
    for (size_t i = 0; i < n_unknowns; ++i) {
      std::getline(in, line);
      names.push_back(line);
    }
    globals = static_cast<int>(n_unknowns) - 6 * static_cast<int>(n_set_ups);
    if (globals != 9 && globals != 12) throw std::runtime_error("9 or 12 unknowns beside the set-ups are expected");
    for (int i = 0; i < unknowns(); ++i) {
      const char* expected = i < globals ? kGlobals[i] : kSetUp[(i - globals) % 6];
      if (names[i].substr(0, names[i].find('@')) != expected) throw std::runtime_error("unexpected unknown " + names[i]);
    }
    // read twice, a touch at a time, so that nothing but the touches stays in memory
    const auto numbers = in.tellg();
    double r[16];
    const auto next_row = [&] {
      in.read(reinterpret_cast<char*>(r), sizeof r);
      if (!in) throw std::runtime_error(path + " is cut short");
    };
    first.assign(n_set_ups + 1, 0);
    for (size_t i = 0; i < n; ++i) next_row(), ++first[static_cast<size_t>(r[15]) + 1];
    in.seekg(numbers);
    for (size_t s = 0; s < n_set_ups; ++s) first[s + 1] += first[s];
    std::vector<size_t> next = first;
    touches.resize(n);
    for (size_t i = 0; i < n; ++i) {
      next_row();
      Touch& t = touches[next[static_cast<size_t>(r[15])]++];
      t.x = r[0], t.y = r[1], t.z = r[2];
      t.sb = std::sin(r[3] * kDeg), t.cb = std::cos(r[3] * kDeg);
      t.sc = std::sin(r[4] * kDeg), t.cc = std::cos(r[4] * kDeg);
      std::memcpy(t.point, r + 5, sizeof t.point);
      std::memcpy(t.normal, r + 8, sizeof t.normal);
      t.radius = r[11];
      std::memcpy(t.ball, r + 12, sizeof t.ball);
      t.set_up = static_cast<int>(r[15]);
    }
  }
};

// v = Rx(a)·v and so on, given sine and cosine; `back` turns the other way.
template <class T, class U>
inline void turn(U& p, U& q, const T& s, const T& c) {
  const U p0 = p;
  p = c * p0 - s * q;
  q = s * p0 + c * q;
}

// The gap at a touch, mm, for any number type: measured less model along the outward normal.
template <class T, int kNumGlobals>
inline T gap(const Touch& t, const SetUp& s, const T* g, const T* b) {
  using std::cos, std::sin;
  T v[3] = {t.ball[0] + g[0], T(t.ball[1]), t.ball[2] + g[1]};
  turn(v[2], v[0], t.sb, t.cb);  // Ry(B)
  const T a0 = g[2] * kDeg, c0 = g[3] * kDeg;
  turn(v[1], v[2], T(sin(a0)), T(cos(a0)));  // Rx
  turn(v[0], v[1], T(sin(c0)), T(cos(c0)));  // Rz
  // a late trigger has let the axes go on against the planned normal
  double r[3] = {t.normal[0], t.normal[1], t.normal[2]};
  if (s.turns) turn(r[0], r[1], t.sc, t.cc);
  v[0] += t.x + g[8] * r[0], v[1] += t.y + g[8] * r[1], v[2] += t.z + g[8] * r[2];
  if constexpr (kNumGlobals == 12) {
    v[0] -= kMicro * (g[9] * t.x - g[11] * t.y);
    v[1] -= kMicro * g[10] * t.y;
  }
  if (s.turns) {
    v[0] -= g[4], v[1] -= g[5];
    const T a = g[6] * kDeg, e = g[7] * kDeg;
    turn(v[2], v[0], T(-sin(e)), T(cos(e)));  // Ry back
    turn(v[1], v[2], T(-sin(a)), T(cos(a)));  // Rx back
    turn(v[0], v[1], -t.sc, t.cc);            // Rz(C) back
  }
  for (int k = 0; k < 3; ++k) v[k] -= s.centre[k] + b[k];
  const T sa = b[3] * kDeg, sb = b[4] * kDeg, sc = b[5] * kDeg;
  turn(v[0], v[1], T(-sin(sc)), T(cos(sc)));
  turn(v[2], v[0], T(-sin(sb)), T(cos(sb)));
  turn(v[1], v[2], T(-sin(sa)), T(cos(sa)));
  T out = T(-t.radius);
  for (int k = 0; k < 3; ++k) out += t.normal[k] * (v[k] + s.centre[k] - t.point[k]);
  return out;
}

// Gaps of touches of one set-up with their derivatives, each times `weight`: by the globals into `by_globals` (a row of
// `n_globals` per touch), by the set-up into `by_set_up` (a row of six); either may be null. In gaps.cpp.
void gaps_and_rows(const Touch* touches, int count, const SetUp& set_up, const double* g, const double* b,
                   int n_globals, double weight, double* gaps, double* by_globals, double* by_set_up);

inline double now_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The largest resident set of this very program, KiB (getrusage would count what the caller had before the exec).
inline long peak_kb() {
  std::ifstream in("/proc/self/status");
  for (std::string line; std::getline(in, line);)
    if (line.rfind("VmHWM:", 0) == 0) return std::stol(line.substr(6));
  return 0;
}

// Writes the answer as JSON: names, values, standard uncertainties (unit: those of the unknowns), times, memory.
inline void answer(const Problem& p, const std::string& solver, const std::vector<double>& theta,
                   const std::vector<double>& sigma, double fit_s, double covariance_s, int iterations,
                   long loaded_kb) {
  std::printf("{\"solver\": \"%s\", \"fit_s\": %.9f, \"covariance_s\": %.9f, \"iterations\": %d, \"loaded_kb\": %ld, \"peak_kb\": %ld,\n",
              solver.c_str(), fit_s, covariance_s, iterations, loaded_kb, peak_kb());
  const char* keys[] = {"value", "sigma"};
  const std::vector<double>* columns[] = {&theta, &sigma};
  std::printf(" \"name\": [");
  for (int i = 0; i < p.unknowns(); ++i) std::printf("%s\"%s\"", i ? ", " : "", p.names[i].c_str());
  std::printf("]");
  for (int k = 0; k < 2; ++k) {
    std::printf(",\n \"%s\": [", keys[k]);
    for (int i = 0; i < p.unknowns(); ++i) std::printf("%s%.17g", i ? ", " : "", (*columns[k])[i]);
    std::printf("]");
  }
  std::printf("}\n");
}
