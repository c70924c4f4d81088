/*
Forecasts the time of a training step on many ranks, by a model of its parts.

  exact half-inverse step, Gram matrix m x m, n weights, layers of total width w:
    own samples      B c / N
    Gram matrix      m^2 w / (r_gram N)
    band reduction   4/3 m^3 / (r_band N)
    panels           (m / b) QR factorizations of b columns, on one rank
    chase            c_chase m^2, on one rank
    numbers          beta (3/2 m^2 + m w + 2 n)
    messages         alpha log2(N) (5 m / b + 10)
  first-order step:  B c / N + beta 2 n + alpha log2(N) 8

The rates are flags, whose defaults are those of docs/results/scaling.md.

Sample runs:

  rank_forecast
  rank_forecast --alpha=2e-6 --beta=1e-9
*/

#include <algorithm>
#include <cmath>
#include <iostream>
#include <string>
#include <utility>
#include <vector>

#include "bin/support/program.h"
#include "fmt/core.h"
#include "gflags/gflags.h"
#include "report/table.h"

DEFINE_double(r_gram, 3.4e10, "multiply-adds a second of the Gram matrix");
DEFINE_double(r_band, 5.6e10, "operations a second of the band reduction");
DEFINE_double(r_panel, 1e10, "operations a second of a panel");
DEFINE_double(c_chase, 1e-8, "seconds of the chase for an entry of m^2");
DEFINE_double(alpha, 2e-6, "seconds of a message, times log2 of the ranks");
DEFINE_double(beta, 3e-9, "seconds of a number that a rank receives");

namespace invgrad {
namespace {

constexpr double kBandwidth = 48.0;

struct Step {
  std::string name;
  bool is_exact;  // a half-inverse step, or one of the first order
  double batch_size;
  double outputs;             // |y|
  double weights;             // n
  double width;               // w
  double seconds_per_sample;  // of the simulation and the network
};

// The parts of the time on N ranks.
std::vector<std::pair<std::string, double>> Parts(const Step& step, double N) {
  // The smaller Gram matrix.
  const double m = std::min(step.batch_size * step.outputs, step.weights);
  const double levels = std::log2(N);
  // A rank has at least one sample.
  const double shares = std::min(N, step.batch_size);
  std::vector<std::pair<std::string, double>> parts = {
      {"samples", step.batch_size * step.seconds_per_sample / shares}};
  if (!step.is_exact) {
    parts.emplace_back("numbers", N > 1 ? FLAGS_beta * 2.0 * step.weights : 0);
    parts.emplace_back("messages", FLAGS_alpha * levels * 8.0);
    return parts;
  }
  parts.emplace_back("Gram", m * m * step.width / (FLAGS_r_gram * N));
  parts.emplace_back("band", 4.0 / 3.0 * m * m * m / (FLAGS_r_band * N));
  parts.emplace_back("panels", m * m * kBandwidth / FLAGS_r_panel);
  parts.emplace_back("chase", FLAGS_c_chase * m * m);
  parts.emplace_back(
      "numbers",
      N > 1 ? FLAGS_beta * (1.5 * m * m + m * step.width + 2.0 * step.weights)
            : 0.0);
  parts.emplace_back("messages",
                     FLAGS_alpha * levels * (5.0 * m / kBandwidth + 10.0));
  return parts;
}

double Total(const Step& step, double N) {
  double total = 0.0;
  for (const auto& [name, seconds] : Parts(step, N)) total += seconds;
  return total;
}

bool Run(RunCounts* counts, std::string* error) {
  if (!CheckFlags({{"r_gram", {1.0}},
                   {"r_band", {1.0}},
                   {"r_panel", {1.0}},
                   {"c_chase", {0.0}},
                   {"alpha", {0.0}},
                   {"beta", {0.0}}},
                  error)) {
    return false;
  }
  // The published sizes [Schnell, Holl, Thuerey 2022], and larger ones.
  const std::vector<Step> steps = {
      {"toy, half-inverse", true, 256, 2, 30, 9, 1e-6},
      {"oscillators, half-inverse", true, 128, 4, 2956, 156, 1e-5},
      {"quantum dipole, half-inverse", true, 16, 28, 9484, 444, 1e-3},
      {"Poisson, half-inverse", true, 64, 64, 24896, 320, 1e-5},
      {"oscillators, Adam", false, 128, 4, 2956, 156, 5e-6},
      {"16 oscillators, 1000 steps, Adam", false, 1024, 32, 22500, 1060, 5e-3},
      {"m = 16,384, n = 1e6", true, 4096, 4, 1e6, 2024, 1e-4},
      {"m = 100,000, n = 1e6", true, 25000, 4, 1e6, 2024, 1e-4}};
  Table table;
  for (const Step& step : steps) {
    table.BeginRow();
    table.Add("step", step.name, Table::Align::kLeft);
    for (const double N : {1.0, 2.0, 4.0, 16.0, 64.0, 256.0, 1024.0}) {
      table.Add(fmt::format("{:.0f}", N),
                fmt::format("{:.2g}", Total(step, N)));
    }
    double best = 1.0;
    for (double N = 1.0; N <= 1024.0; N *= 2.0) {
      if (Total(step, N) < Total(step, best)) best = N;
    }
    const std::vector<std::pair<std::string, double>> parts = Parts(step, best);
    const auto largest = std::max_element(
        parts.begin(), parts.end(), [](const auto& a, const auto& b) {
          return a.second < b.second;
        });
    table.Add("fastest", fmt::format("{:.0f}", best));
    table.Add("there most", largest->first, Table::Align::kLeft);
  }
  std::cout << "Forecast: seconds of a step on so many ranks\n\n"
            << table.ToText();
  counts->Add(true);
  return true;
}

}  // namespace
}  // namespace invgrad

int main(int argc, char** argv) {
  return invgrad::RunProgram(
      argc,
      argv,
      "forecasts the time of a training step on many ranks\n\n"
      "  rank_forecast --beta=1e-9",
      invgrad::Run);
}
