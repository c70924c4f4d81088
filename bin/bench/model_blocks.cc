// blocks/PROBLEM/BLOCKS: ten iterations of ceres::Solve on a network and a
// simulator as cost functions (invgrad/cost.h), with all samples in one residual
// block or with few in each. DENSE_NORMAL_CHOLESKY.
//
//   one              one block, one thread
//   32, 1            so many samples a block
//   32_2threads      the same with two of Ceres' threads

#include <memory>
#include <string>

#include "benchmark/benchmark.h"
#include "bin/bench/bench.h"
#include "ceres/problem.h"
#include "ceres/solver.h"
#include "invgrad/cost.h"
#include "problems/ceres_problem.h"

namespace invgrad {
namespace {

void AddBlocks(const std::string& problem,
               const std::string& method,
               int samples_per_block,
               int num_threads) {
  const std::string name = "blocks/" + problem + "/";
  AddBenchmark(
      name + method,
      method == "one" ? "" : name + "one",
      [problem, samples_per_block, num_threads](benchmark::State& state) {
        for (auto _ : state) {
          state.PauseTiming();
          ModelBlockOptions blocks;
          blocks.samples_per_block = samples_per_block;
          CeresProblem made;
          std::string error;
          if (!CreateCeresProblem(problem, blocks, &made, &error)) {
            state.SkipWithError(error.c_str());
            return;
          }
          ceres::Solver::Options options;
          options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
          options.max_num_iterations = 10;
          options.num_threads = num_threads;
          options.logging_type = ceres::SILENT;
          ceres::Solver::Summary summary;
          state.ResumeTiming();
          ceres::Solve(options, made.problem.get(), &summary);
        }
      });
}

}  // namespace

bool AddModelBlockBenchmarks(std::string* /*error*/) {
  for (const std::string problem : {"oscillator_chain:num_samples=512",
                                    "toy_network:num_samples=2048",
                                    "oscillator_correction:num_samples=256"}) {
    AddBlocks(problem, "one", 0, 1);
    AddBlocks(problem, "32", 32, 1);
    AddBlocks(problem, "32_2threads", 32, 2);
    AddBlocks(problem, "1", 1, 1);
  }
  return true;
}

}  // namespace invgrad
