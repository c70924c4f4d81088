// The benchmarks of the program bench, one source a subject.
//
// A benchmark is named SUBJECT[/CASE]/METHOD. Data are made when the first
// benchmark of a case runs, so that the others of the filter cost nothing.
#ifndef BIN_BENCH_BENCH_H_
#define BIN_BENCH_BENCH_H_

#include <functional>
#include <string>

#include "benchmark/benchmark.h"
#include "bin/support/training_flags.h"
#include "gflags/gflags.h"
#include "invgrad/compare/problem.h"
#include "invgrad/train.h"

DECLARE_string(input);

namespace invgrad {

// Adds a benchmark, in milliseconds. The program prints at its end how many
// times the time of the benchmark `reference` it takes; "": no ratio.
benchmark::internal::Benchmark* AddBenchmark(
    const std::string& name,
    const std::string& reference,
    std::function<void(benchmark::State&)> measure);

// The flags of training and ranks, and their check.
TrainingFlags& BenchTraining();
bool CheckBenchTraining(std::string* error);

// The problem of --problem and of the network's flags, or null, with *error; and
// its training by the flags --steps and --batch_size.
const LearningProblem* FlagsProblem(std::string* error);
TrainOptions FlagsOptions(const LearningProblem& problem);

// Each adds the benchmarks of a subject, or returns false, with *error, if a
// flag is not valid.
bool AddStepBenchmarks(std::string* error);
bool AddJacobianBenchmarks(std::string* error);
bool AddFieldBenchmarks(std::string* error);
bool AddTrainingBenchmarks(std::string* error);
bool AddCallbackBenchmarks(std::string* error);
bool AddModelBlockBenchmarks(std::string* error);
bool AddDeterminedStepBenchmarks(std::string* error);
bool AddCovarianceBenchmarks(std::string* error);
bool AddManyFitsBenchmarks(std::string* error);
bool AddStreamingFitBenchmarks(std::string* error);
bool AddGlobalFitBenchmarks(std::string* error);
bool AddExponentialsBenchmarks(std::string* error);
bool AddTorchBenchmarks(std::string* error);  // where libtorch is found
bool AddRankBenchmarks(std::string* error);   // where MPI is found

}  // namespace invgrad

#endif  // BIN_BENCH_BENCH_H_
