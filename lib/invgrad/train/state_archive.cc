#include "invgrad/train/state_archive.h"

#include "fmt/core.h"
#include "glog/logging.h"

namespace invgrad {

void StateArchive::Visit(const std::string& name,
                         Eigen::VectorXd* values,
                         Eigen::Index size) {
  if (!is_reading()) {
    const bool is_new =
        checkpoint_.arrays.emplace(prefix_ + name, *values).second;
    CHECK(is_new) << name << " is visited twice";
    return;
  }
  const auto found = checkpoint_.arrays.find(prefix_ + name);
  Require(found != checkpoint_.arrays.end() &&
              (size < 0 || found->second.size() == size),
          name);
  if (error_.empty()) *values = found->second;
}

void StateArchive::Visit(const std::string& name, double* value) {
  Eigen::VectorXd array = Eigen::VectorXd::Constant(1, *value);
  Visit(name, &array, 1);
  *value = array[0];
}

void StateArchive::Visit(const std::string& name, long* value) {
  double number = static_cast<double>(*value);
  Visit(name, &number);
  *value = static_cast<long>(number);
}

void StateArchive::Visit(const std::string& name, int* value) {
  long number = *value;
  Visit(name, &number);
  *value = static_cast<int>(number);
}

void StateArchive::Visit(const std::string& name, std::vector<int>* values) {
  Eigen::VectorXd array =
      Eigen::Map<const Eigen::VectorXi>(
          values->data(), static_cast<Eigen::Index>(values->size()))
          .cast<double>();
  Visit(name, &array);
  values->assign(array.begin(), array.end());
}

void StateArchive::Expect(const std::string& name, long value) {
  long found = value;
  Visit(name, &found);
  if (error_.empty() && found != value) {
    error_ = fmt::format("found {}={}, wanted {}", name, found, value);
  }
}

void StateArchive::Require(bool fits, const std::string& name) {
  if (fits || !error_.empty() || !is_reading()) return;
  error_ = fmt::format("array '{}' is missing or does not fit this run",
                       prefix_ + name);
}

}  // namespace invgrad
