#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <sstream>
#include <string_view>
#include <utility>
#include <vector>

#include "fmt/ranges.h"
#include "invgrad/core/specification.h"
#include "invgrad/dense_network.h"
#include "invgrad/internal/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

constexpr std::string_view kMagic = "invgrad network 1";
constexpr int kNumHeaderLines = 4;
constexpr size_t kMaxShown = 60;  // of a line, in a message

// Removes a complete line from *rest and returns it; empty if there is none:
// a number without a line end may lack digits.
std::string_view TakeLine(std::string_view* rest) {
  const size_t end = rest->find('\n');
  if (end == std::string_view::npos) return {};
  const std::string_view line = rest->substr(0, end);
  rest->remove_prefix(end + 1);
  return line;
}

std::string WidthsLine(const std::vector<int>& widths) {
  return fmt::format("widths {}", fmt::join(widths, " "));
}

std::optional<DenseNetwork> ParseNetwork(std::string_view rest,
                                         Eigen::VectorXd* weights,
                                         std::string* problem) {
  if (TakeLine(&rest) != kMagic) {
    *problem = fmt::format(
        "not a network (it does not begin with the line '{}')", kMagic);
    return std::nullopt;
  }
  const std::string line(TakeLine(&rest));
  std::istringstream numbers(
      line.substr(std::min(line.find(' '), line.size())));
  const std::vector<int> widths(std::istream_iterator<int>(numbers), {});
  if (widths.size() < 2 ||
      *std::min_element(widths.begin(), widths.end()) < 1 ||
      line != WidthsLine(widths)) {
    *problem =
        "line 2 is not 'widths' and at least two positive numbers, each after "
        "one space";
    return std::nullopt;
  }
  const double wanted = DenseNetwork::CountWeights(widths);
  if (wanted > std::numeric_limits<int>::max()) {
    *problem =
        fmt::format("the widths in line 2 stand for more than {} weights",
                    std::numeric_limits<int>::max());
    return std::nullopt;
  }
  const std::string_view name = TakeLine(&rest);
  const auto* const activation = std::find_if(
      std::begin(kActivations), std::end(kActivations), [name](Activation a) {
        return name == fmt::format("activation {}", ActivationName(a));
      });
  if (activation == std::end(kActivations)) {
    *problem = "line 3 is not 'activation' and one of";
    for (const Activation known : kActivations) {
      *problem += std::string(" ") + ActivationName(known);
    }
    return std::nullopt;
  }
  const int count = static_cast<int>(wanted);
  if (TakeLine(&rest) != fmt::format("weights {}", count)) {
    *problem = fmt::format(
        "line 4 is not 'weights {}', as many as its widths have", count);
    return std::nullopt;
  }
  // A weight takes at least a digit and a line end.
  if (rest.size() / 2 < static_cast<size_t>(count)) {
    *problem = fmt::format("too short for {} weights", count);
    return std::nullopt;
  }
  Eigen::VectorXd values(count);
  for (int i = 0; i < count; ++i) {
    if (rest.find('\n') == std::string_view::npos) {
      *problem = fmt::format("ends within weight {} of {}", i + 1, count);
      return std::nullopt;
    }
    const std::string_view text = TakeLine(&rest);
    const char* const end = text.data() + text.size();
    const auto [parsed, status] = std::from_chars(text.data(), end, values[i]);
    if (status != std::errc() || parsed != end || !std::isfinite(values[i])) {
      *problem = fmt::format("line {} is not a finite number: '{}'",
                             kNumHeaderLines + 1 + i,
                             Printable(text, kMaxShown));
      return std::nullopt;
    }
  }
  if (!rest.empty()) {
    *problem = fmt::format("goes on after its {} weights", count);
    return std::nullopt;
  }
  *weights = std::move(values);
  return DenseNetwork(widths, *activation);
}

}  // namespace

bool WriteNetwork(const std::string& path,
                  const DenseNetwork& network,
                  const Eigen::VectorXd& weights,
                  std::string* error) {
  CHECK_EQ(weights.size(), network.num_weights());
  std::string text = fmt::format("{}\n{}\nactivation {}\nweights {}\n",
                                 kMagic,
                                 WidthsLine(network.widths()),
                                 ActivationName(network.hidden_activation()),
                                 weights.size());
  for (const double weight : weights) {
    char digits[32];  // the shortest text that gives back a double: at most 24
    const auto [end, status] =
        std::to_chars(std::begin(digits), std::end(digits), weight);
    CHECK(status == std::errc());
    text.append(digits, end);
    text += '\n';
  }
  return WriteFile(path, text, error);
}

std::optional<DenseNetwork> ReadNetwork(const std::string& path,
                                        Eigen::VectorXd* weights,
                                        std::string* error) {
  CHECK(weights != nullptr);
  CHECK(error != nullptr);
  std::string bytes;
  if (!ReadFile(path, &bytes, error)) return std::nullopt;
  std::string problem;
  std::optional<DenseNetwork> network = ParseNetwork(bytes, weights, &problem);
  if (!network.has_value()) *error = fmt::format("file {}: {}", path, problem);
  return network;
}

}  // namespace invgrad
