#include "bin/registration/results.h"

#include <algorithm>
#include <map>

#include "bin/support/run_output.h"
#include "fmt/core.h"
#include "report/plot.h"
#include "report/table.h"

namespace invgrad {
namespace {

using Runs = std::vector<const RegistrationRun*>;

Table DriftCsv(const std::vector<RegistrationRun>& runs) {
  Table csv;
  for (const RegistrationRun& run : runs) {
    for (size_t k = 0; k < run.track.scans.size(); ++k) {
      const TrackedScan& scan = run.track.scans[k];
      csv.BeginRow();
      csv.Add("scene", run.scene.name);
      csv.Add("method", run.method);
      csv.Add("unit", run.unit);
      csv.Add("seed", std::to_string(run.seed));
      csv.Add("scan", std::to_string(k));
      csv.Add("left_alone", std::to_string(scan.num_left_alone));
      csv.Add("determined_m", ExactNumber(scan.position_drift[0]));
      csv.Add("determined_rad", ExactNumber(scan.rotation_drift[0]));
      csv.Add("undetermined_m", ExactNumber(scan.position_drift[1]));
      csv.Add("undetermined_rad", ExactNumber(scan.rotation_drift[1]));
      csv.Add("x_m", ExactNumber(scan.pose.translation().x()));
      csv.Add("y_m", ExactNumber(scan.pose.translation().y()));
      csv.Add("z_m", ExactNumber(scan.pose.translation().z()));
    }
  }
  return csv;
}

// "1", or "0-2" over all alignments; "-" of a method that leaves none alone.
std::string LeftAlone(const Runs& runs) {
  int low = 6;
  int high = -1;
  for (const RegistrationRun* run : runs) {
    for (size_t k = 1; k < run->track.scans.size(); ++k) {
      low = std::min(low, run->track.scans[k].num_left_alone);
      high = std::max(high, run->track.scans[k].num_left_alone);
    }
  }
  if (high < 0) return "-";
  return low == high ? std::to_string(low) : fmt::format("{}-{}", low, high);
}

// The drift after the last scan, the median of the runs; "-" if the scene has
// no such axis. `axes`: the first of three in Scene::is_undetermined.
std::string Drift(const Runs& runs,
                  double (TrackedScan::*drift)[2],
                  int axes,
                  bool is_undetermined,
                  double factor) {
  const auto group = runs[0]->scene.is_undetermined.segment<3>(axes);
  if (is_undetermined ? !group.any() : group.all()) return "-";
  std::vector<double> last;
  for (const RegistrationRun* run : runs) {
    last.push_back(factor * (run->track.scans.back().*drift)[is_undetermined]);
  }
  return fmt::format("{:.2f}", SeedSpread(last).median);
}

Table DriftTable(const std::vector<Runs>& groups) {
  Table table;
  for (const Runs& runs : groups) {
    table.BeginRow();
    table.Add("scene", runs[0]->scene.name, Table::Align::kLeft);
    table.Add("method", runs[0]->method, Table::Align::kLeft);
    table.Add("unit", runs[0]->unit, Table::Align::kLeft);
    table.Add("left alone", LeftAlone(runs));
    for (const bool i : {false, true}) {
      const std::string name = i ? "undetermined" : "determined";
      table.Add(name + " [cm]",
                Drift(runs, &TrackedScan::position_drift, 0, i, 100.0));
      table.Add(name + " [mrad]",
                Drift(runs, &TrackedScan::rotation_drift, 3, i, 1e3));
    }
  }
  return table;
}

// The runs that one row of the table, or one curve, is made of.
std::vector<Runs> Group(const std::vector<RegistrationRun>& runs) {
  std::vector<Runs> groups;
  for (const RegistrationRun& run : runs) {
    const RegistrationRun* before =
        groups.empty() ? nullptr : groups.back().back();
    if (before == nullptr || before->scene.name != run.scene.name ||
        before->method != run.method || before->unit != run.unit) {
      groups.emplace_back();
    }
    groups.back().push_back(&run);
  }
  return groups;
}

Plot PathPlot(const Runs& runs) {
  Plot plot;
  plot.title = runs[0]->scene.name;
  plot.x_label = "x [m]";
  plot.y_label = "y [m], stretched";  // the paths are long and narrow
  Series truth;
  truth.title = "true";
  for (size_t k = 0; k < runs[0]->track.scans.size(); ++k) {
    const Eigen::Isometry3d pose =
        PathPose(runs[0]->scene, static_cast<int>(k));
    truth.x.push_back(pose.translation().x());
    truth.y.push_back(pose.translation().y());
  }
  plot.series.push_back(truth);
  for (const RegistrationRun* run : runs) {
    Series path;
    path.title = run->method;
    for (const TrackedScan& scan : run->track.scans) {
      path.x.push_back(scan.pose.translation().x());
      path.y.push_back(scan.pose.translation().y());
    }
    plot.series.push_back(path);
  }
  return plot;
}

// Its colours are those of PathPlot.
Plot DriftPlot(const Runs& runs, bool is_undetermined) {
  Plot plot;
  plot.title = runs[0]->scene.name;
  plot.x_label = "scan";
  plot.y_label = is_undetermined ? "undetermined [cm]" : "determined [cm]";
  plot.log_y = true;
  for (size_t i = 0; i < runs.size(); ++i) {
    Series series;
    series.title = runs[i]->method;
    series.color = static_cast<int>(i) + 1;
    const std::vector<TrackedScan>& scans = runs[i]->track.scans;
    for (size_t k = 1; k < scans.size(); ++k) {
      series.x.push_back(static_cast<double>(k));
      series.y.push_back(100.0 * scans[k].position_drift[is_undetermined]);
    }
    plot.series.push_back(series);
  }
  return plot;
}

void Draw(const std::string& folder, const std::vector<Runs>& groups) {
  std::vector<Runs> scenes;  // of each method the first run
  for (const Runs& runs : groups) {
    const RegistrationRun& run = *runs[0];
    if (run.unit != groups[0][0]->unit) continue;
    if (scenes.empty() || scenes.back()[0]->scene.name != run.scene.name) {
      scenes.emplace_back();
    }
    scenes.back().push_back(&run);
  }
  std::vector<Plot> paths, determined, undetermined;
  for (const Runs& runs : scenes) {
    paths.push_back(PathPlot(runs));
    determined.push_back(DriftPlot(runs, false));
    if (runs[0]->scene.is_undetermined.head<3>().any()) {
      undetermined.push_back(DriftPlot(runs, true));
    }
  }
  DrawPictures({{folder + "/trajectories.png", paths},
                {folder + "/determined.png", determined},
                {folder + "/undetermined.png", undetermined}});
}

}  // namespace

bool WriteRegistrationResults(const std::string& folder,
                              const std::vector<RegistrationRun>& runs,
                              std::string* error) {
  const std::vector<Runs> groups = Group(runs);
  const Table table = DriftTable(groups);
  fmt::print("{}", table.ToText());
  if (!WriteTable(folder + "/table", table, error) ||
      !WriteRunFile(folder + "/drift.csv", DriftCsv(runs).ToCsv(), error)) {
    return false;
  }
  fmt::print("results in {}\n", folder);
  if (!groups.empty()) Draw(folder, groups);
  return true;
}

}  // namespace invgrad
