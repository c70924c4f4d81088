/*
Aligns the scans of a path, one to the next, in scenes that do not determine all
directions, and measures the drift along the determined and the undetermined
ones.

Sample runs:

  registration --scenes=corridor --scans=20 --methods=lm,determined
  registration --units=m,mm --methods=determined,eigenvalue:100 --seeds=1..3
  registration --scenes=room --noise=0.03 --outliers=0.2 --output=runs/room
  registration --scenes=room --guard_edges=false --output=runs/edges
  registration --cylinder --methods=gauss_newton,determined --seeds=1..20

The scenes are those of problems/registration/scan.h. Each alignment starts at
the odometry (bin/registration/track.h), and is solved by:

  odometry      nothing
  lm            ceres::Solve
  half_inverse  proposals of half_inverse:step_size=auto:rho=1 alone
  gauss_newton  proposals of Gauss-Newton alone
  eigenvalue:T  the same without the eigenvectors of
                H = J^T J whose eigenvalues are at most T, in the units of H
  determined    proposals of determined:groups=blocks alone

With --cylinder it makes one alignment instead, that of a published comparison
(bin/registration/cylinder_study.h), by odometry, gauss_newton, eigenvalue:T or
determined.

bin/registration/results.h lists what is written. Ctrl-C ends the current path,
skips the others, and keeps the results so far.
*/

#include <string>
#include <utility>
#include <vector>

#include "bin/registration/cylinder_study.h"
#include "bin/registration/methods.h"
#include "bin/registration/results.h"
#include "bin/registration/track.h"
#include "bin/support/output_options.h"
#include "bin/support/program.h"
#include "bin/support/run_output.h"
#include "gflags/gflags.h"
#include "problems/registration/scan.h"
#include "report/interrupt.h"

DEFINE_string(scenes,
              "room,corridor,tunnel,plane,cylinder",
              "which scenes, comma-separated");
DEFINE_string(methods,
              "odometry,lm,half_inverse,eigenvalue:10,eigenvalue:100,"
              "determined",
              "which methods, comma-separated; of --cylinder by default "
              "odometry,gauss_newton,eigenvalue:10,eigenvalue:120,determined");
DEFINE_int32(scans, 100, "alignments of a path");
DEFINE_string(seeds, "1", "of the noise: 1,2,5 or 1..3");
DEFINE_double(noise, 0.01, "standard deviation of the ranges [m]");
DEFINE_double(outliers, 0.05, "share of the rays with any range");
DEFINE_string(units, "m", "of lengths: m, mm, or m,mm");
DEFINE_double(tau,
              0.0,
              "threshold of `determined`; 0: from the normals of the first "
              "scan, at least 0.1");

DEFINE_bool(cylinder, false, "the cylinder of a published comparison");
DEFINE_bool(guard_edges,
            true,
            "reject normals of two walls, and matches with large residuals");

namespace invgrad {
namespace {

bool SelectScenes(const std::string& text,
                  std::vector<Scene>* scenes,
                  std::string* error) {
  for (const std::string& name : SplitList(text)) {
    std::string known;
    bool is_known = false;
    for (const Scene& scene : Scenes()) {
      known += (known.empty() ? "" : ", ") + scene.name;
      if (scene.name == name) {
        scenes->push_back(scene);
        is_known = true;
      }
    }
    if (!is_known) {
      *error = "unknown scene '" + name + "'; known: " + known;
      return false;
    }
  }
  if (scenes->empty()) *error = "expected a scene";
  return !scenes->empty();
}

bool SelectUnits(const std::string& text,
                 std::vector<std::string>* units,
                 std::string* error) {
  *units = SplitList(text);
  for (const std::string& unit : *units) {
    if (unit != "m" && unit != "mm") {
      *error = "unknown unit '" + unit + "'; known: m, mm";
      return false;
    }
  }
  if (units->empty()) *error = "expected a unit";
  return !units->empty();
}

bool Run(RunCounts* counts, std::string* error) {
  std::vector<Scene> scenes;
  std::vector<RegistrationMethod> methods;
  std::vector<std::string> units;
  std::vector<int> seeds;
  if (FLAGS_cylinder &&
      gflags::GetCommandLineFlagInfoOrDie("methods").is_default) {
    FLAGS_methods =
        "odometry,gauss_newton,eigenvalue:10,eigenvalue:120,determined";
  }
  if (!CheckFlags({{"scans", {1.0, 10000.0}},
                   {"noise", {0.0, 1.0}},
                   {"outliers", {0.0, 1.0}},
                   {"tau", {0.0, 0.5}}},
                  error) ||
      !ParseFlag("scenes", SelectScenes, &scenes, error) ||
      !ParseFlag("methods", ParseRegistrationMethods, &methods, error) ||
      !NameFlag("methods",
                !FLAGS_cylinder || CheckCylinderMethods(methods, error),
                error) ||
      (FLAGS_cylinder &&
       !CheckNotGiven({"scenes", "scans", "outliers", "units", "guard_edges"},
                      "is not for --cylinder",
                      error)) ||
      !ParseFlag("units", SelectUnits, &units, error) ||
      !ParseFlag("seeds", ParseSeeds, &seeds, error) ||
      !PrepareRunDirectory(ExistingDirectory::kRefuse, error)) {
    return false;
  }
  const Interrupt interrupt;
  if (FLAGS_cylinder) {
    CylinderOptions options;
    options.noise = FLAGS_noise;
    if (FLAGS_tau > 0.0) options.tau = FLAGS_tau;
    return StudyCylinder(
        methods, seeds, options, Output().output, counts, error);
  }
  TrackOptions options;
  options.num_scans = FLAGS_scans;
  options.tau = FLAGS_tau;
  options.guards_edges = FLAGS_guard_edges;
  options.scan.noise = FLAGS_noise;
  options.scan.outliers = FLAGS_outliers;
  std::vector<RegistrationRun> runs;
  for (const Scene& scene : scenes) {
    for (const RegistrationMethod& method : methods) {
      for (const std::string& unit : units) {
        options.scan.unit = unit == "mm" ? 1000.0 : 1.0;
        for (const int seed : seeds) {
          options.seed = seed;
          Track track = TrackScans(scene, method, options);
          if (Interrupt::IsRequested()) continue;
          counts->Add(track.is_finite);
          runs.push_back({scene, method.label, unit, seed, std::move(track)});
        }
      }
    }
  }
  return WriteRegistrationResults(Output().output, runs, error);
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  invgrad::AddOutputFlags(/*shows_progress=*/false);
  return invgrad::RunProgram(
      argc,
      argv,
      "aligns scans in scenes that do not determine all directions",
      invgrad::Run);
}
