#include "invgrad/chain/network_file.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iterator>
#include <limits>
#include <string_view>
#include <vector>

#include "fmt/format.h"
#include "glog/logging.h"
#include "invgrad/io/atomic_file.h"

namespace invgrad {
namespace {

constexpr std::string_view kMagic = "invgrad network 1";

// All of `text` as a number.
template <typename T>
bool ParseNumber(std::string_view text, T* value) {
  const char* const end = text.data() + text.size();
  const auto [parsed, status] = std::from_chars(text.data(), end, *value);
  return status == std::errc() && parsed == end;
}

// The unread part of the file, read line by line.
class Lines {
 public:
  explicit Lines(std::string_view rest) : rest_(rest) {}

  // Returns false if there is no complete line: the last number may lack
  // digits.
  bool Take(std::string_view* line) {
    const size_t end = rest_.find('\n');
    if (end == std::string_view::npos) return false;
    *line = rest_.substr(0, end);
    rest_.remove_prefix(end + 1);
    return true;
  }

  // The text after "key " on the next line.
  bool TakeValue(std::string_view key, std::string_view* value) {
    std::string_view line;
    if (!Take(&line) || line.substr(0, key.size()) != key ||
        line.substr(key.size(), 1) != " ") {
      return false;
    }
    *value = line.substr(key.size() + 1);
    return true;
  }

  size_t num_bytes() const { return rest_.size(); }

 private:
  std::string_view rest_;
};

bool ParseWidths(std::string_view text, std::vector<int>* widths) {
  while (true) {
    const size_t end = std::min(text.find(' '), text.size());
    int width = 0;
    if (!ParseNumber(text.substr(0, end), &width) || width < 1) return false;
    widths->push_back(width);
    if (end == text.size()) return widths->size() >= 2;
    text.remove_prefix(end + 1);
  }
}

bool ParseActivation(std::string_view name, Activation* activation) {
  const auto* const found = std::find_if(
      std::begin(kActivations), std::end(kActivations), [name](Activation a) {
        return name == ActivationName(a);
      });
  if (found == std::end(kActivations)) return false;
  *activation = *found;
  return true;
}

// Quotes text of a damaged file in a message.
std::string Quoted(std::string_view text) {
  constexpr size_t kMaxShown = 60;
  std::string shown(text.substr(0, kMaxShown));
  for (char& c : shown) {
    if (c < ' ' || c > '~') c = '?';
  }
  return "'" + shown + (text.size() > kMaxShown ? "...'" : "'");
}

std::optional<DenseNetwork> ParseNetwork(std::string_view bytes,
                                         Eigen::VectorXd* weights,
                                         std::string* problem) {
  Lines lines(bytes);
  std::string_view text;
  if (!lines.Take(&text) || text != kMagic) {
    *problem = fmt::format(
        "not a network (it does not begin with the line '{}')", kMagic);
    return std::nullopt;
  }
  std::vector<int> widths;
  if (!lines.TakeValue("widths", &text) || !ParseWidths(text, &widths)) {
    *problem =
        "line 2 is not 'widths' and at least two positive numbers, each after "
        "one space";
    return std::nullopt;
  }
  const double wanted = DenseNetwork::CountWeights(widths);
  if (wanted > std::numeric_limits<int>::max()) {
    *problem =
        fmt::format("line 2 asks for more than the {} weights that are allowed",
                    std::numeric_limits<int>::max());
    return std::nullopt;
  }
  Activation activation = Activation::kLinear;
  if (!lines.TakeValue("activation", &text) ||
      !ParseActivation(text, &activation)) {
    *problem = "line 3 is not 'activation' and one of";
    for (const Activation known : kActivations) {
      *problem += std::string(" ") + ActivationName(known);
    }
    return std::nullopt;
  }
  int count = 0;
  if (!lines.TakeValue("weights", &text) || !ParseNumber(text, &count) ||
      count != wanted) {
    *problem =
        fmt::format("line 4 is not 'weights {}', as many as its widths have",
                    static_cast<int>(wanted));
    return std::nullopt;
  }
  // A weight takes at least a digit and a line end.
  if (lines.num_bytes() / 2 < static_cast<size_t>(count)) {
    *problem = fmt::format("too short for {} weights", count);
    return std::nullopt;
  }
  constexpr int kHeaderLines = 4;
  Eigen::VectorXd values(count);
  for (int i = 0; i < count; ++i) {
    if (!lines.Take(&text)) {
      *problem = fmt::format("ends within weight {} of {}", i + 1, count);
      return std::nullopt;
    }
    if (!ParseNumber(text, &values[i]) || !std::isfinite(values[i])) {
      *problem = fmt::format("line {} is not a finite number: {}",
                             kHeaderLines + 1 + i,
                             Quoted(text));
      return std::nullopt;
    }
  }
  if (lines.num_bytes() > 0) {
    *problem = fmt::format("goes on after its {} weights", count);
    return std::nullopt;
  }
  *weights = std::move(values);
  return DenseNetwork(std::move(widths), activation);
}

}  // namespace

bool WriteNetwork(const std::string& path,
                  const DenseNetwork& network,
                  const Eigen::VectorXd& weights,
                  std::string* error) {
  CHECK_EQ(weights.size(), network.num_weights());
  std::string text = fmt::format("{}\nwidths {}\nactivation {}\nweights {}\n",
                                 kMagic,
                                 fmt::join(network.widths(), " "),
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
