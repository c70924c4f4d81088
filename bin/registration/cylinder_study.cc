#include "bin/registration/cylinder_study.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "Eigen/Dense"
#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "glog/logging.h"
#include "invgrad/determined_step.h"
#include "problems/registration/cylinder.h"
#include "report/interrupt.h"
#include "report/table.h"

namespace invgrad {
namespace {

using Eigen::Isometry3d;
using Eigen::Vector3d;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Kind = RegistrationMethod::Kind;

constexpr double kDegree = 3.14159265358979323846 / 180.0;

struct CylinderRun {
  std::string clouds;
  std::string method;
  int seed = 0;
  int num_steps = 0;
  int num_left_alone = -1;                  // by the last step; -1: no step
  Vector6d eigenvalues = Vector6d::Zero();  // of the first H, ascending
  Vector6d error = Vector6d::Zero();  // position [m], rotation vector [degrees]
};

Isometry3d Start() {
  Isometry3d pose = Isometry3d::Identity();
  pose.translate(Vector3d(0.2, 0.8, 0.5));
  pose.rotate(Eigen::AngleAxisd(2.0 * kDegree, Vector3d::UnitZ()));
  pose.rotate(Eigen::AngleAxisd(0.1 * kDegree, Vector3d::UnitY()));
  pose.rotate(Eigen::AngleAxisd(0.1 * kDegree, Vector3d::UnitX()));
  return pose;
}

Vector6d ErrorOf(const Isometry3d& pose) {
  const Eigen::AngleAxisd turn(pose.linear());
  Vector6d error;
  error << pose.translation(), turn.angle() / kDegree * turn.axis();
  return error;
}

struct Clouds {
  Eigen::Matrix3Xd scan, target;
};

Clouds MakeClouds(const std::string& clouds, int seed, double noise) {
  // No two seeds of a study share a stream.
  const std::uint32_t first = 10u * static_cast<std::uint32_t>(seed);
  const Eigen::Matrix3Xd target = MakeCylinder(first);
  if (clouds == "others") return {MakeCylinder(first + 1), target};
  if (clouds == "same") return {target, target};
  return {WithNoise(target, noise, first + 2),
          WithNoise(target, noise, first + 3)};
}

class Stepper {
 public:
  Stepper(const RegistrationMethod& method, double tau)
      : method_(method), determined_({tau, 0.0, {3, 3}}) {}

  bool Step(const LocalPlaneSums& sums,
            Eigen::VectorXd* step,
            int* num_left_alone,
            std::string* error) {
    if (method_.kind == Kind::kEigenvalue) {
      return EigenvalueStep(sums.H,
                            sums.gradient,
                            method_.eigenvalue,
                            step,
                            num_left_alone,
                            error);
    }
    DeterminedStep::Vector found;
    if (!determined_.Compute(sums.H, sums.gradient, &found, error)) {
      return false;
    }
    *step = found;
    *num_left_alone = determined_.num_left_alone();
    return true;
  }

 private:
  const RegistrationMethod method_;
  DeterminedStep determined_;
};

using CylinderRuns = std::vector<const CylinderRun*>;

template <typename Value>
double Median(const CylinderRuns& runs, const Value& value) {
  std::vector<double> values;
  for (const CylinderRun* run : runs) values.push_back(value(*run));
  return SeedSpread(values).median;
}

std::string LeftAloneText(const CylinderRuns& runs) {
  const auto less = [](const CylinderRun* a, const CylinderRun* b) {
    return a->num_left_alone < b->num_left_alone;
  };
  const auto range = std::minmax_element(runs.begin(), runs.end(), less);
  const int low = (*range.first)->num_left_alone;
  const int high = (*range.second)->num_left_alone;
  if (high < 0) return "-";
  return low == high ? std::to_string(low) : fmt::format("{}-{}", low, high);
}

void AddRow(const CylinderRuns& runs, Table* table) {
  const auto add = [&](const std::string& title, const auto& value) {
    table->Add(title, fmt::format("{:.4f}", Median(runs, value)));
  };
  table->BeginRow();
  table->Add("clouds", runs[0]->clouds, Table::Align::kLeft);
  table->Add("method", runs[0]->method, Table::Align::kLeft);
  table->Add("left alone", LeftAloneText(runs));
  table->Add("steps",
             fmt::format("{:g}", Median(runs, [](const CylinderRun& run) {
                           return run.num_steps;
                         })));
  add("position [m]", [](const auto& run) { return run.error.head(3).norm(); });
  add("rotation [deg]",
      [](const auto& run) { return run.error.tail(3).norm(); });
  add("x, y [m]", [](const auto& run) { return run.error.head(2).norm(); });
  add("roll, pitch [deg]",
      [](const auto& run) { return run.error.segment(3, 2).norm(); });
  add("z [m]", [](const auto& run) { return std::abs(run.error[2]); });
  add("yaw [deg]", [](const auto& run) { return std::abs(run.error[5]); });
}

Table AllRuns(const std::vector<CylinderRun>& runs) {
  Table csv;
  for (const CylinderRun& run : runs) {
    csv.BeginRow();
    csv.Add("clouds", run.clouds);
    csv.Add("method", run.method);
    csv.Add("seed", std::to_string(run.seed));
    csv.Add("steps", std::to_string(run.num_steps));
    csv.Add("left_alone", std::to_string(run.num_left_alone));
    const char* const names[] = {
        "x_m", "y_m", "z_m", "roll_deg", "pitch_deg", "yaw_deg"};
    for (int i = 0; i < 6; ++i) csv.Add(names[i], ExactNumber(run.error[i]));
    for (int i = 0; i < 6; ++i) {
      csv.Add(fmt::format("eigenvalue_{}", i), ExactNumber(run.eigenvalues[i]));
    }
  }
  return csv;
}

void PrintEigenvalues(const CylinderRuns& runs) {
  fmt::print("{}: eigenvalues of the first H:", runs[0]->clouds);
  for (int i = 0; i < 6; ++i) {
    fmt::print(" {:.3g}", Median(runs, [i](const CylinderRun& run) {
                 return run.eigenvalues[i];
               }));
  }
  fmt::print("\n");
}

bool RunCylinder(const std::string& clouds,
                 const RegistrationMethod& method,
                 int seed,
                 const CylinderOptions& options,
                 CylinderRun* run,
                 std::string* error) {
  constexpr int kMaxSteps = 30;
  constexpr double kMinShift = 1e-3;
  constexpr double kMinTurn = 1e-4;
  const Clouds pair = MakeClouds(clouds, seed, options.noise);
  const LocalPlanes planes(pair.target);
  Isometry3d pose = Start();
  LocalPlaneSums sums = planes.SumsAt(pair.scan, pose);
  run->clouds = clouds;
  run->method = method.label;
  run->seed = seed;
  run->eigenvalues =
      Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(Eigen::MatrixXd(sums.H))
          .eigenvalues();
  Stepper stepper(method, options.tau);
  bool is_done = method.kind == Kind::kOdometry;
  while (!is_done && run->num_steps < kMaxSteps) {
    Eigen::VectorXd step;
    if (!stepper.Step(sums, &step, &run->num_left_alone, error)) return false;
    ++run->num_steps;
    pose = Moved(pose, step);
    is_done = step.head(3).norm() < kMinShift && step.tail(3).norm() < kMinTurn;
    if (!is_done) sums = planes.SumsAt(pair.scan, pose);
  }
  run->error = ErrorOf(pose);
  return true;
}

}  // namespace

bool CheckCylinderMethods(const std::vector<RegistrationMethod>& methods,
                          std::string* error) {
  for (const RegistrationMethod& method : methods) {
    if (method.kind == Kind::kOdometry || method.kind == Kind::kEigenvalue ||
        method.kind == Kind::kDetermined) {
      continue;
    }
    *error = fmt::format(
        "the cylinder has no method '{}'; known: odometry, gauss_newton, "
        "eigenvalue:THRESHOLD, determined",
        method.label);
    return false;
  }
  return true;
}

bool StudyCylinder(const std::vector<RegistrationMethod>& methods,
                   const std::vector<int>& seeds,
                   const CylinderOptions& options,
                   const std::string& folder,
                   RunCounts* counts,
                   std::string* error) {
  CHECK(CheckCylinderMethods(methods, error)) << *error;
  std::vector<CylinderRun> runs;
  for (const char* const clouds : {"same", "noise", "others"}) {
    for (const RegistrationMethod& method : methods) {
      for (const int seed : seeds) {
        if (Interrupt::IsRequested()) break;
        CylinderRun& run = runs.emplace_back();
        std::string failure;
        if (!RunCylinder(clouds, method, seed, options, &run, &failure)) {
          Warn(
              fmt::format("{} {} {}: {}", clouds, method.label, seed, failure));
          run.error.setConstant(std::numeric_limits<double>::quiet_NaN());
        }
        counts->Add(run.error.allFinite());
      }
    }
  }
  Table table;
  for (size_t first = 0; first < runs.size();) {
    CylinderRuns group;
    while (first < runs.size() &&
           (group.empty() || (runs[first].clouds == group[0]->clouds &&
                              runs[first].method == group[0]->method))) {
      group.push_back(&runs[first++]);
    }
    AddRow(group, &table);
    if (group[0]->method == methods[0].label) PrintEigenvalues(group);
  }
  fmt::print("{}", table.ToText());
  if (!WriteTable(folder + "/cylinder", table, error) ||
      !WriteRunFile(folder + "/cylinder.csv", AllRuns(runs).ToCsv(), error)) {
    return false;
  }
  fmt::print("results in {}\n", folder);
  return true;
}

}  // namespace invgrad
