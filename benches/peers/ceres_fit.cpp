// Ceres on the same touches and unknowns.
//
//     ceres_fit PROBLEM DERIVATIVES SOLVER COVARIANCE THREADS REPEATS
//
// DERIVATIVES  automatic (dual numbers, a cost function per touch) or analytic (a cost function per 64 touches of one
//              set-up, so that sines of the error angles are taken once for all of them)
// SOLVER       dense-normal, dense-normal-lapack, dense-qr, dense-qr-lapack, sparse-normal, dense-schur
// COVARIANCE   dense-svd, sparse-qr (ceres::Covariance), or normal: inverse of JᵀJ by hand from Ceres' own Jacobian
#include <ceres/ceres.h>
#include <glog/logging.h>

#include <Eigen/Dense>
#include <memory>

#include "problem.hpp"

namespace {

template <int kNumGlobals>
struct Gap {
  const Touch* touch;
  const SetUp* set_up;
  double weight;
  template <class T>
  bool operator()(const T* g, const T* b, T* residual) const {
    residual[0] = weight * gap<T, kNumGlobals>(*touch, *set_up, g, b);
    return true;
  }
};

class Gaps : public ceres::CostFunction {
 public:
  Gaps(const Touch* touches, int count, const SetUp* set_up, int n_globals, double weight)
      : touches_(touches), set_up_(set_up), n_globals_(n_globals), weight_(weight) {
    set_num_residuals(count);
    mutable_parameter_block_sizes()->assign({n_globals, 6});
  }
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    gaps_and_rows(touches_, num_residuals(), *set_up_, parameters[0], parameters[1], n_globals_, weight_, residuals,
                  jacobians ? jacobians[0] : nullptr, jacobians ? jacobians[1] : nullptr);
    return true;
  }

 private:
  const Touch* touches_;
  const SetUp* set_up_;
  int n_globals_;
  double weight_;
};

void choose_solver(const std::string& word, ceres::Solver::Options& options) {
  options.dense_linear_algebra_library_type = ceres::EIGEN;
  if (word == "dense-normal" || word == "dense-normal-lapack") {
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
  } else if (word == "dense-qr" || word == "dense-qr-lapack") {
    options.linear_solver_type = ceres::DENSE_QR;
  } else if (word == "sparse-normal") {
    options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  } else if (word == "dense-schur") {
    options.linear_solver_type = ceres::DENSE_SCHUR;
  } else {
    throw std::runtime_error("unknown solver " + word);
  }
  if (word.size() > 7 && word.substr(word.size() - 7) == "-lapack") options.dense_linear_algebra_library_type = ceres::LAPACK;
}

std::vector<double> uncertainties(ceres::Problem& problem, const Problem& p, std::vector<double>& theta,
                                  const std::string& how, int n_threads) {
  const int n = p.unknowns();
  std::vector<double> sigma(n);
  std::vector<const double*> blocks = {theta.data()};
  for (size_t s = 0; s < p.set_ups.size(); ++s) blocks.push_back(theta.data() + p.globals + 6 * s);
  if (how == "normal") {
    ceres::Problem::EvaluateOptions options;
    options.num_threads = n_threads;
    for (const double* b : blocks) options.parameter_blocks.push_back(const_cast<double*>(b));
    ceres::CRSMatrix jacobian;
    problem.Evaluate(options, nullptr, nullptr, nullptr, &jacobian);
    Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(n, n);
    for (int i = 0; i < jacobian.num_rows; ++i)
      for (int a = jacobian.rows[i]; a < jacobian.rows[i + 1]; ++a)
        for (int b = jacobian.rows[i]; b <= a; ++b)
          normal(jacobian.cols[a], jacobian.cols[b]) += jacobian.values[a] * jacobian.values[b];
    const Eigen::VectorXd scale = normal.diagonal().cwiseSqrt();
    const Eigen::MatrixXd full = normal.selfadjointView<Eigen::Lower>();
    const Eigen::MatrixXd scaled = scale.cwiseInverse().asDiagonal() * full * scale.cwiseInverse().asDiagonal();
    const Eigen::MatrixXd inverse = scaled.llt().solve(Eigen::MatrixXd::Identity(n, n));
    for (int i = 0; i < n; ++i) sigma[i] = std::sqrt(inverse(i, i)) / scale[i];
    return sigma;
  }
  ceres::Covariance::Options options;
  options.num_threads = n_threads;
  options.algorithm_type = how == "dense-svd" ? ceres::DENSE_SVD : ceres::SPARSE_QR;
  if (how == "sparse-qr") options.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  // columns are per unit (mm, deg, um/m): their sizes differ by four powers of ten without any loss of rank
  options.min_reciprocal_condition_number = 1e-20;
  ceres::Covariance covariance(options);
  if (!covariance.Compute(blocks, &problem)) throw std::runtime_error("ceres::Covariance failed");
  std::vector<double> all(static_cast<size_t>(n) * n);
  if (!covariance.GetCovarianceMatrix(blocks, all.data())) throw std::runtime_error("ceres::Covariance gives no matrix");
  for (int i = 0; i < n; ++i) sigma[i] = std::sqrt(all[static_cast<size_t>(i) * n + i]);
  return sigma;
}

struct Fit {
  std::vector<double> theta, sigma;
  double fit_s, covariance_s;
  int iterations;
};

Fit fit(const Problem& p, const std::string& derivatives, const std::string& solver, const std::string& how, int n_threads) {
  const double start = now_s();
  std::vector<double> theta(p.unknowns(), 0.0);
  ceres::Problem problem;
  const double weight = 1.0 / p.sigma;
  for (size_t s = 0; s < p.set_ups.size(); ++s) {
    double* b = theta.data() + p.globals + 6 * s;
    for (size_t i = p.first[s]; i < p.first[s + 1];) {
      ceres::CostFunction* cost = nullptr;
      size_t count = 1;
      if (derivatives == "analytic") {
        count = std::min<size_t>(64, p.first[s + 1] - i);
        cost = new Gaps(&p.touches[i], static_cast<int>(count), &p.set_ups[s], p.globals, weight);
      } else if (p.globals == 9) {
        cost = new ceres::AutoDiffCostFunction<Gap<9>, 1, 9, 6>(new Gap<9>{&p.touches[i], &p.set_ups[s], weight});
      } else {
        cost = new ceres::AutoDiffCostFunction<Gap<12>, 1, 12, 6>(new Gap<12>{&p.touches[i], &p.set_ups[s], weight});
      }
      problem.AddResidualBlock(cost, nullptr, theta.data(), b);
      i += count;
    }
  }
  ceres::Solver::Options options;
  choose_solver(solver, options);
  options.num_threads = n_threads;
  // as good as Gauss-Newton: no damping that is felt, and an end where the others end
  options.initial_trust_region_radius = 1e16;
  options.max_trust_region_radius = 1e32;
  options.min_lm_diagonal = 1e-32;
  options.function_tolerance = 1e-12;
  options.gradient_tolerance = 0.0;
  options.parameter_tolerance = 1e-12;
  options.max_num_iterations = 50;
  options.logging_type = ceres::SILENT;
  if (options.linear_solver_type == ceres::DENSE_SCHUR) {
    auto* order = new ceres::ParameterBlockOrdering;
    for (size_t s = 0; s < p.set_ups.size(); ++s) order->AddElementToGroup(theta.data() + p.globals + 6 * s, 0);
    order->AddElementToGroup(theta.data(), 1);
    options.linear_solver_ordering.reset(order);
  }
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  const double fitted = now_s();
  if (!summary.IsSolutionUsable()) throw std::runtime_error(summary.message);
  const std::vector<double> sigma = uncertainties(problem, p, theta, how, n_threads);
  return {theta, sigma, fitted - start, now_s() - fitted, summary.num_successful_steps + summary.num_unsuccessful_steps};
}

}  // namespace

int main(int argc, char** argv) try {
  google::InitGoogleLogging(argv[0]);
  FLAGS_minloglevel = google::GLOG_ERROR;
  if (argc != 7) throw std::runtime_error("ceres_fit PROBLEM DERIVATIVES SOLVER COVARIANCE THREADS REPEATS");
  const Problem p(argv[1]);
  const std::string derivatives = argv[2], solver = argv[3], how = argv[4];
  const long loaded = peak_kb();
  Fit best = fit(p, derivatives, solver, how, std::stoi(argv[5]));
  for (int i = 1; i < std::stoi(argv[6]); ++i) {
    const Fit again = fit(p, derivatives, solver, how, std::stoi(argv[5]));
    if (again.fit_s + again.covariance_s < best.fit_s + best.covariance_s) best = again;
  }
  answer(p, "ceres " + derivatives + " " + solver + " " + how, best.theta, best.sigma, best.fit_s, best.covariance_s,
         best.iterations, loaded);
} catch (const std::exception& e) {
  std::fprintf(stderr, "ceres_fit: %s\n", e.what());
  return 1;
}
