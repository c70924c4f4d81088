// Trains a network of libtorch in front of a simulator of fields, in a program
// of one's own.
//
// Sample run, which writes train_torch_network.txt:
//
//   build/release/bin/train_torch_network
//
// docs/tutorials/train_torch_network.md explains each part.

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <memory>
#include <random>
#include <string>

#include "Eigen/Core"
#include "glog/logging.h"
#include "invgrad/blas_threads.h"
#include "invgrad/field_simulator.h"
#include "invgrad/torch_network.h"
#include "invgrad/train.h"

namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr int kNumCells = 64;

// [network]
// Maps the field that is seen to the field that caused it.
struct Network : torch::nn::Module {
  Network() { register_module("layers", layers); }
  torch::Tensor forward(const torch::Tensor& field) {
    return layers->forward(field);
  }
  static torch::nn::Conv1d Convolution(int in, int out) {
    return torch::nn::Conv1d(torch::nn::Conv1dOptions(in, out, 9)
                                 .padding(4)
                                 .padding_mode(torch::kCircular));
  }
  torch::nn::Sequential layers{Convolution(1, 8),
                               torch::nn::GELU(),
                               Convolution(8, 8),
                               torch::nn::GELU(),
                               Convolution(8, 1)};
};
// [/network]

// [simulator]
// A camera out of focus that saturates: y = tanh(A x), where A is 8 times the
// mean of a cell and its neighbours with weights 1/4, 1/2, 1/4, periodically.
class Camera final : public invgrad::FieldSimulator {
 public:
  int num_inputs() const override { return kNumCells; }
  int num_outputs() const override { return kNumCells; }

  bool Value(const double* x,
             const double* /*context*/,
             double* y) const override {
    Eigen::Map<VectorXd>(y, kNumCells) =
        Blurred(Eigen::Map<const VectorXd>(x, kNumCells)).array().tanh();
    return invgrad::AllFinite(y, kNumCells);
  }

  // J = diag(1 - y^2) A, and A = A^T.
  std::unique_ptr<const invgrad::JacobianOperator> Linearize(
      const double* x, const double* context, double* y) const override {
    if (!Value(x, context, y)) return nullptr;
    const VectorXd slopes =
        1.0 - Eigen::Map<const Eigen::ArrayXd>(y, kNumCells).square();
    return std::make_unique<invgrad::FunctionJacobian>(
        kNumCells,
        kNumCells,
        [slopes](const VectorXd& v, VectorXd* Jv) {
          *Jv = slopes.cwiseProduct(Blurred(v));
        },
        [slopes](const VectorXd& w, VectorXd* Jtw) {
          *Jtw = Blurred(slopes.cwiseProduct(w));
        });
  }

 private:
  static VectorXd Blurred(VectorXd field) {
    for (int k = 0; k < 8; ++k) {
      const VectorXd before = field;
      for (int i = 0; i < kNumCells; ++i) {
        field[i] =
            0.5 * before[i] + 0.25 * (before[(i + 1) % kNumCells] +
                                      before[(i + kNumCells - 1) % kNumCells]);
      }
    }
    return field;
  }
};
// [/simulator]

// Two boxes a sample, of random places, widths and heights.
MatrixXd RandomFields(int num_samples, unsigned seed) {
  std::mt19937 generator(seed);
  const auto random = [&generator](int size) {
    return static_cast<int>(generator() % size);
  };
  MatrixXd fields = MatrixXd::Zero(kNumCells, num_samples);
  for (int s = 0; s < num_samples; ++s) {
    for (int box = 0; box < 2; ++box) {
      const int first = random(kNumCells), width = 6 + random(12);
      const double height = 0.2 + 0.1 * random(8);
      for (int i = 0; i < width; ++i) {
        fields((first + i) % kNumCells, s) += height;
      }
    }
  }
  return fields;
}

}  // namespace

// train_torch_network [seconds of a method]
int main(int argc, char** argv) {
  invgrad::SetBlasThreads(1);
  const auto camera = std::make_shared<Camera>();
  const MatrixXd truth = RandomFields(256, 1);
  MatrixXd seen(kNumCells, truth.cols());
  for (int s = 0; s < truth.cols(); ++s) {
    CHECK(camera->Value(truth.col(s).data(), nullptr, seen.col(s).data()));
  }

  // [model]
  invgrad::TorchNetworkOptions options;
  options.name = "deblurring";
  options.input_shape = {1, kNumCells};  // channels, cells
  std::string error;
  const std::shared_ptr<const invgrad::Network> network =
      invgrad::MakeTorchNetwork(
          [] { return invgrad::FunctionOfModule(std::make_shared<Network>()); },
          options,
          &error);
  if (network == nullptr) LOG(FATAL) << error;
  const invgrad::Model model(
      network,
      camera,
      std::make_shared<invgrad::SquaredNormLoss>(kNumCells, 0.5),
      invgrad::Reduction::kMean);
  // [/model]

  // [train]
  MatrixXd best;
  for (const char* method : {"adam:step_size=3e-3", "hessian_free", "krylov"}) {
    invgrad::TrainOptions train;
    train.batch_size = 64;
    train.max_time_in_seconds = argc > 1 ? std::atof(argv[1]) : 5.0;
    train.cpu_time = true;  // on a busy machine, too
    const invgrad::TrainResult result =
        invgrad::Train(model, {seen, seen}, method, train);
    if (!result.error.empty()) LOG(FATAL) << result.error;
    const MatrixXd x = network->Outputs(result.weights, seen);
    std::printf("%-20s %5ld steps, loss %.2e, mean |x - truth| %.3f\n",
                method,
                result.summary.num_steps,
                result.history.back().train_loss,
                (x - truth).cwiseAbs().mean());
    best = x;
  }
  // [/train]

  std::ofstream file("train_torch_network.txt");
  for (int i = 0; i < kNumCells; ++i) {
    file << i << ' ' << truth(i, 0) << ' ' << seen(i, 0) << ' ' << best(i, 0)
         << '\n';
  }
  return 0;
}
