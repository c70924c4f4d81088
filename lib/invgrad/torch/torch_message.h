// The first line of an exception's message: libtorch adds stack traces.
#ifndef INVGRAD_TORCH_TORCH_MESSAGE_H_
#define INVGRAD_TORCH_TORCH_MESSAGE_H_

#include <exception>
#include <string>

#include "c10/util/Exception.h"

namespace invgrad {

inline std::string TorchMessage(const std::exception& exception) {
  const auto* error = dynamic_cast<const c10::Error*>(&exception);
  const std::string text =
      error == nullptr ? exception.what() : error->what_without_backtrace();
  return text.substr(0, text.find('\n'));
}

}  // namespace invgrad

#endif  // INVGRAD_TORCH_TORCH_MESSAGE_H_
