#include "report/html_profiles.h"

#include "fmt/core.h"

namespace invgrad {

HtmlReport::Chart ProfileChart(const std::string& places,
                               const std::vector<ProfileWork>& works) {
  HtmlReport::Chart chart;
  chart.title = "Profiles";
  chart.has_steps = true;
  for (const double tolerance : {1e-3, 1e-1, 1e-5, 1e-7}) {
    for (const ProfileWork& work : works) {
      const Eigen::MatrixXd all = WorkToSolve(work.traces, tolerance);
      if (all.rows() < 2) continue;
      const auto add = [&](const std::string& x_label,
                           std::vector<Series> series) {
        Plot& view = chart.views.emplace_back();
        view.title = fmt::format("tolerance {:.0e}", tolerance);
        view.x_label = x_label;
        view.y_label = fmt::format("share of {} {}", all.rows(), places);
        view.log_x = true;
        view.y_range = {0.0, 1.0};
        view.series = std::move(series);
      };
      add(work.name + " / " + work.name + " of the best method",
          PerformanceProfile(all));
      add(work.name, DataProfile(all));
    }
  }
  chart.caption = fmt::format(
      "The share of {0} that a method has solved: by multiples of the best "
      "method's work (performance profile of Dolan and Moré), or by work (data "
      "profile of Moré and Wild). Solved: the cost has fallen to the least one "
      "of all methods, up to the tolerance times the whole fall. Higher is "
      "better; the left end says how often a method is the fastest, the right "
      "end how many {0} it solves at all.",
      places);
  return chart;
}

}  // namespace invgrad
