# What makes compiling faster and changes no result.
#
#   invgrad_precompile(TARGET)                    precompiles the headers of other
#                                                 libraries that most sources use
#   invgrad_precompile(TARGET HEADERS h...)       and these, before the others
#   invgrad_precompile(TARGET REUSE_FROM OTHER)   uses OTHER's, which must be
#                                                 compiled with the same flags
#
# CMAKE_DISABLE_PRECOMPILE_HEADERS=ON switches them off, as clang-tidy needs.

# ccache stores what is compiled with precompiled headers only if told that their
# macros and dates do not matter.
if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache$"
    AND NOT CMAKE_DISABLE_PRECOMPILE_HEADERS)
  set(CMAKE_CXX_COMPILER_LAUNCHER ${CMAKE_COMMAND} -E env
    CCACHE_SLOPPINESS=pch_defines,time_macros,include_file_mtime,include_file_ctime
    ${CMAKE_CXX_COMPILER_LAUNCHER})
  add_compile_options($<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endif()

function(invgrad_precompile target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" REUSE_FROM HEADERS)
  if(arg_REUSE_FROM)
    target_precompile_headers(${target} REUSE_FROM ${arg_REUSE_FROM})
  else()
    target_precompile_headers(${target} PRIVATE ${arg_HEADERS}
      <algorithm> <cmath> <functional> <limits> <map> <memory> <optional>
      <sstream> <string> <utility> <vector>
      <Eigen/Core> <Eigen/SparseCore> <ceres/autodiff_cost_function.h>
      <ceres/problem.h> <fmt/core.h> <glog/logging.h>)
  endif()
endfunction()
