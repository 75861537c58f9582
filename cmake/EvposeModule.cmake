set(EVPOSE_TEST_TIMEOUT 300)
if(CMAKE_CROSSCOMPILING)  # an emulator is some twenty times slower
  set(EVPOSE_TEST_TIMEOUT 600)
endif()

# evpose_module(NAME SOURCES ... [LINKS ...] [PRIVATE_LINKS ...] [TESTS ...])
#   library evpose_NAME (evpose::NAME); its unit tests, if any, are the program evpose_NAME_test.
function(evpose_module name)
  cmake_parse_arguments(ARG "" "" "SOURCES;LINKS;PRIVATE_LINKS;TESTS" ${ARGN})
  add_library(evpose_${name} STATIC ${ARG_SOURCES})
  add_library(evpose::${name} ALIAS evpose_${name})
  target_include_directories(evpose_${name} PUBLIC
    $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src> $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
  target_link_libraries(evpose_${name} PUBLIC ${ARG_LINKS}
    PRIVATE $<BUILD_INTERFACE:evpose_options> ${ARG_PRIVATE_LINKS})
  target_compile_features(evpose_${name} PUBLIC cxx_std_20)
  set_target_properties(evpose_${name} PROPERTIES POSITION_INDEPENDENT_CODE ON EXPORT_NAME ${name})
  set_property(GLOBAL APPEND PROPERTY EVPOSE_MODULES ${name})
  evpose_precompile(evpose_${name} evpose_precompiled)
  evpose_unity(evpose_${name})
  if(EVPOSE_TESTS AND ARG_TESTS)
    add_executable(evpose_${name}_test ${ARG_TESTS})
    target_link_libraries(evpose_${name}_test PRIVATE evpose_${name} evpose_options GTest::gtest_main)
    evpose_precompile(evpose_${name}_test evpose_precompiled_test)
    evpose_unity(evpose_${name}_test)
    gtest_discover_tests(evpose_${name}_test TEST_PREFIX "${name}." DISCOVERY_TIMEOUT 60
                         PROPERTIES TIMEOUT ${EVPOSE_TEST_TIMEOUT} LABELS unit)
  endif()
endfunction()

add_library(evpose_options INTERFACE)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_LESS 13)
  target_compile_options(evpose_options INTERFACE -Wno-restrict)  # false alarms about std::string of GCC 12 at -O3
endif()
target_compile_options(evpose_options INTERFACE
  -Wall -Wextra -Wpedantic -Wshadow -Wconversion -Wno-sign-conversion -Wno-float-conversion -Wnon-virtual-dtor)
# Functions of one file pass vectors of eight numbers, which no other compiler has to agree about.
target_compile_options(evpose_options INTERFACE -Wno-psabi)
# No multiplication is joined with an addition: what is inlined where, and how strongly it is optimised, then makes no
# difference to a result, and every build gives the same trajectories to the last bit.
target_compile_options(evpose_options INTERFACE -ffp-contract=off)
if(EVPOSE_WERROR)
  target_compile_options(evpose_options INTERFACE -Werror)
endif()
if(EVPOSE_PROCESSOR STREQUAL native)
  target_compile_options(evpose_options INTERFACE -march=native)
elseif(EVPOSE_PROCESSOR STREQUAL recent)
  if(CMAKE_SYSTEM_PROCESSOR MATCHES "x86_64|AMD64")
    target_compile_options(evpose_options INTERFACE -march=x86-64-v3)
  elseif(CMAKE_SYSTEM_PROCESSOR MATCHES "aarch64|arm64")
    target_compile_options(evpose_options INTERFACE -march=armv8-a)
  endif()
elseif(NOT EVPOSE_PROCESSOR STREQUAL any)
  message(FATAL_ERROR "EVPOSE_PROCESSOR is ${EVPOSE_PROCESSOR}; there are: recent any native")
endif()
if(EVPOSE_SANITIZE)
  add_compile_options(-fsanitize=${EVPOSE_SANITIZE} -fno-omit-frame-pointer)
  add_link_options(-fsanitize=${EVPOSE_SANITIZE})
endif()

# Eigen lays out its small vectors, and takes memory for its large ones, by the instruction set of the *including*
# file: fix both, so that a consumer compiled for another processor agrees with the library about every struct and
# gives memory back the way it was taken.
add_library(evpose_eigen INTERFACE)
target_link_libraries(evpose_eigen INTERFACE Eigen3::Eigen)
target_compile_definitions(evpose_eigen INTERFACE EIGEN_MAX_STATIC_ALIGN_BYTES=16 EIGEN_MAX_ALIGN_BYTES=32)
set_target_properties(evpose_eigen PROPERTIES EXPORT_NAME eigen)

# Precompiled headers: outside headers that nearly every source includes. Headers of the project are not among them: a
# change to one would rebuild everything. A source still includes all that it uses. GCC takes no headers that were
# compiled with other options, hence a set for the modules (position-independent), one for their tests and one for all
# other programs.
set(precompiled_headers
  <Eigen/Cholesky> <Eigen/Core> <Eigen/Eigenvalues> <Eigen/Geometry> <Eigen/LU> <algorithm> <array> <charconv>
  <chrono> <cmath> <cstdint> <cstdio> <cstring> <deque> <filesystem> <fstream> <functional> <limits> <map> <memory>
  <mutex> <numbers> <numeric> <optional> <random> <set> <span> <sstream> <stdexcept> <string> <string_view> <thread>
  <tuple> <unordered_map> <utility> <variant> <vector>)

# evpose_precompiled_headers(NAME [HEADER...] [LIBRARIES ...]): these, which come with the libraries, and the common ones,
# for targets to use by evpose_precompile.
function(evpose_precompiled_headers name)
  if(NOT EVPOSE_PRECOMPILED)
    return()
  endif()
  cmake_parse_arguments(ARG "" "" LIBRARIES ${ARGN})
  set(source ${CMAKE_CURRENT_BINARY_DIR}/${name}.cpp)
  file(CONFIGURE OUTPUT ${source} CONTENT "")
  add_library(${name} OBJECT EXCLUDE_FROM_ALL ${source})
  target_link_libraries(${name} PRIVATE evpose_options evpose_eigen ${ARG_LIBRARIES})
  target_precompile_headers(${name} PRIVATE ${precompiled_headers} ${ARG_UNPARSED_ARGUMENTS})
endfunction()

function(evpose_precompile target headers)
  if(EVPOSE_PRECOMPILED)
    target_precompile_headers(${target} REUSE_FROM ${headers})
  endif()
endfunction()

evpose_precompiled_headers(evpose_precompiled)
if(EVPOSE_PRECOMPILED)
  set_target_properties(evpose_precompiled PROPERTIES POSITION_INDEPENDENT_CODE ON)
endif()
if(NOT EVPOSE_ONLY)
  evpose_precompiled_headers(evpose_precompiled_program <CLI/CLI.hpp> LIBRARIES CLI11::CLI11)
endif()
if(EVPOSE_TESTS)
  evpose_precompiled_headers(evpose_precompiled_test <gtest/gtest.h> LIBRARIES GTest::gtest)
endif()
