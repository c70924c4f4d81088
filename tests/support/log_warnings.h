// Keeps the warnings that are logged while it exists.
#ifndef INVGRAD_TESTS_SUPPORT_LOG_WARNINGS_H_
#define INVGRAD_TESTS_SUPPORT_LOG_WARNINGS_H_

#include <cstddef>
#include <ctime>
#include <string>
#include <vector>

#include "glog/logging.h"

namespace invgrad {

class LogWarnings final : public google::LogSink {
 public:
  LogWarnings() { google::AddLogSink(this); }
  ~LogWarnings() override { google::RemoveLogSink(this); }
  LogWarnings(const LogWarnings&) = delete;
  LogWarnings& operator=(const LogWarnings&) = delete;

  void send(google::LogSeverity severity,
            const char* /*path*/,
            const char* /*file*/,
            int /*line*/,
            const std::tm* /*time*/,
            const char* message,
            size_t length) override {
    if (severity == google::GLOG_WARNING) texts_.emplace_back(message, length);
  }

  // Of those with these words, "" for all.
  int Count(const std::string& words) const {
    int count = 0;
    for (const std::string& text : texts_) {
      count += text.find(words) != std::string::npos ? 1 : 0;
    }
    return count;
  }

 private:
  std::vector<std::string> texts_;
};

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_LOG_WARNINGS_H_
