# Precompiled headers and unity builds, which make compiling faster.
#
#   invgrad_precompile(TARGET)                    precompiles the headers of other
#                                                 libraries that most sources use
#   invgrad_precompile(TARGET HEADERS h...)       and these, before the others
#   invgrad_precompile(TARGET REUSE_FROM OTHER)   uses OTHER's, which must be
#                                                 compiled with the same flags
#   invgrad_unite(TARGET)                         compiles up to 16 sources of a
#                                                 folder as one
#
# With -DCMAKE_UNITY_BUILD=ON, which bin/*.sh set for a new build folder, a build
# from scratch takes less than a third of the time, and after a change in one
# source up to 16 are compiled. Names in the anonymous namespaces of a folder must
# then differ.
# -DCMAKE_DISABLE_PRECOMPILE_HEADERS=ON switches those headers off; clang-tidy
# needs both off.

# GCC's garbage collection, which takes a tenth of the time, begins above 2.5 GB.
if(PROJECT_IS_TOP_LEVEL AND CMAKE_CXX_COMPILER_ID STREQUAL "GNU")
  add_compile_options("SHELL:--param ggc-min-heapsize=2500000")
endif()

# ccache supports precompiled headers only if it ignores their macros and dates.
if(CMAKE_CXX_COMPILER_LAUNCHER MATCHES "ccache$"
    AND NOT CMAKE_DISABLE_PRECOMPILE_HEADERS)
  list(PREPEND CMAKE_CXX_COMPILER_LAUNCHER
    ${CMAKE_COMMAND} -E env CCACHE_SLOPPINESS=pch_defines,time_macros)
  add_compile_options($<$<CXX_COMPILER_ID:GNU>:-fpch-preprocess>)
endif()

function(invgrad_precompile target)
  cmake_parse_arguments(PARSE_ARGV 1 arg "" REUSE_FROM HEADERS)
  # Precompiled headers need the same macros everywhere.
  target_compile_definitions(${target} PRIVATE
    $<TARGET_PROPERTY:fmt::fmt,INTERFACE_COMPILE_DEFINITIONS>)
  if(arg_REUSE_FROM)
    target_precompile_headers(${target} REUSE_FROM ${arg_REUSE_FROM})
  else()
    target_precompile_headers(${target} PRIVATE ${arg_HEADERS}
      <algorithm> <cmath> <functional> <limits> <map> <memory> <optional>
      <sstream> <string> <utility> <vector>
      <Eigen/Core> <Eigen/SparseCore> <ceres/autodiff_cost_function.h>
      <ceres/problem.h> <fmt/core.h>
      "${PROJECT_SOURCE_DIR}/lib/invgrad/internal/logging.h"
      "${PROJECT_SOURCE_DIR}/lib/invgrad/core/eigen_templates.h")
  endif()
endfunction()

function(invgrad_unite target)
  set_target_properties(${target} PROPERTIES UNITY_BUILD_MODE GROUP)
  get_target_property(sources ${target} SOURCES)
  foreach(source ${sources})
    cmake_path(GET source PARENT_PATH folder)
    cmake_path(RELATIVE_PATH folder BASE_DIRECTORY ${PROJECT_SOURCE_DIR})
    string(MAKE_C_IDENTIFIER "${folder}" folder)
    if(NOT DEFINED count_${folder})
      set(count_${folder} 0)
    endif()
    math(EXPR batch "${count_${folder}} / 16")
    math(EXPR count_${folder} "${count_${folder}} + 1")
    set_source_files_properties(${source} PROPERTIES
      UNITY_GROUP ${folder}_${batch})
  endforeach()
endfunction()
