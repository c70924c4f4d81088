// One method by its text, for tests.
#ifndef INVGRAD_TESTS_SUPPORT_PARSE_METHOD_H_
#define INVGRAD_TESTS_SUPPORT_PARSE_METHOD_H_

#include <string>

#include "gtest/gtest.h"
#include "invgrad/method.h"

namespace invgrad {

inline Method ParseMethod(const std::string& text) {
  Method method;
  std::string error;
  EXPECT_TRUE(ParseMethod(text, &method, &error)) << error;
  return method;
}

}  // namespace invgrad

#endif  // INVGRAD_TESTS_SUPPORT_PARSE_METHOD_H_
