// The yardstick: Gauss-Newton written by hand for this very problem. Dense normal equations, built block by block of
// touches so that the Jacobian never exists as a whole.
//
//     newton_fit PROBLEM THREADS REPEATS
#include <Eigen/Dense>
#include <thread>

#include "analytic.hpp"

namespace {

constexpr int kRows = 256;

struct Part {
  Eigen::MatrixXd normal;
  Eigen::VectorXd right;
};

void accumulate(const Problem& p, const double* theta, size_t begin, size_t end, Part& part) {
  const int n = p.unknowns(), g = p.globals;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> rows(kRows, n);
  Eigen::VectorXd gaps(kRows);
  part.normal.setZero(n, n);
  part.right.setZero(n);
  for (size_t at = begin; at < end; at += kRows) {
    const int count = static_cast<int>(std::min<size_t>(kRows, end - at));
    rows.setZero();
    int set_up = -1;
    Angles angles(theta, theta + g);
    for (int i = 0; i < count; ++i) {
      const Touch& t = p.touches[at + i];
      const double* b = theta + g + 6 * t.set_up;
      if (t.set_up != set_up) angles = Angles(theta, b), set_up = t.set_up;
      gaps[i] = gap_and_row(t, p.set_ups[t.set_up], theta, b, angles, g, rows.row(i).data(),
                            rows.row(i).data() + g + 6 * t.set_up);
    }
    const auto block = rows.topRows(count);
    part.normal.selfadjointView<Eigen::Lower>().rankUpdate(block.transpose());
    part.right.noalias() += block.transpose() * gaps.head(count);
  }
}

struct Fit {
  std::vector<double> theta, sigma;
  double fit_s, covariance_s;
  int iterations;
};

Fit fit(const Problem& p, size_t n_threads) {
  const double start = now_s();
  const int n = p.unknowns();
  Eigen::VectorXd theta = Eigen::VectorXd::Zero(n);
  std::vector<Part> parts(n_threads);
  Eigen::LLT<Eigen::MatrixXd> factor;
  Eigen::VectorXd scale;
  const size_t share = (p.touches.size() + n_threads - 1) / n_threads;
  int iterations = 0;
  while (true) {
    std::vector<std::thread> threads;
    for (size_t k = 1; k < n_threads; ++k)
      threads.emplace_back([&, k] {
        accumulate(p, theta.data(), k * share, std::min(p.touches.size(), (k + 1) * share), parts[k]);
      });
    accumulate(p, theta.data(), 0, std::min(p.touches.size(), share), parts[0]);
    for (auto& t : threads) t.join();
    for (size_t k = 1; k < n_threads; ++k) parts[0].normal += parts[k].normal, parts[0].right += parts[k].right;
    // scaled to unit columns: millimetres and micrometres per metre stand side by side
    scale = parts[0].normal.diagonal().cwiseSqrt();
    const Eigen::MatrixXd full = parts[0].normal.selfadjointView<Eigen::Lower>();
    factor.compute(scale.cwiseInverse().asDiagonal() * full * scale.cwiseInverse().asDiagonal());
    if (factor.info() != Eigen::Success) throw std::runtime_error("the normal equations are singular");
    const Eigen::VectorXd phi = factor.solve(-parts[0].right.cwiseQuotient(scale));
    theta += phi.cwiseQuotient(scale);
    ++iterations;
    if (phi.lpNorm<Eigen::Infinity>() < 1e-11 * std::sqrt(double(p.touches.size())) || iterations == 50) break;
  }
  const double fitted = now_s();
  const Eigen::VectorXd variance = factor.solve(Eigen::MatrixXd::Identity(n, n)).diagonal().cwiseQuotient(scale.cwiseAbs2());
  std::vector<double> sigma(n);
  for (int i = 0; i < n; ++i) sigma[i] = p.sigma * std::sqrt(variance[i]);
  return {{theta.data(), theta.data() + n}, sigma, fitted - start, now_s() - fitted, iterations};
}

}  // namespace

int main(int argc, char** argv) try {
  if (argc != 4) throw std::runtime_error("newton_fit PROBLEM THREADS REPEATS");
  const Problem p(argv[1]);
  const long loaded = peak_kb();
  Fit best = fit(p, std::stoul(argv[2]));
  for (int i = 1; i < std::stoi(argv[3]); ++i) {
    const Fit again = fit(p, std::stoul(argv[2]));
    if (again.fit_s + again.covariance_s < best.fit_s + best.covariance_s) best = again;
  }
  answer(p, "newton", best.theta, best.sigma, best.fit_s, best.covariance_s, best.iterations, loaded);
} catch (const std::exception& e) {
  std::fprintf(stderr, "newton_fit: %s\n", e.what());
  return 1;
}
