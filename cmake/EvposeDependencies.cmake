# Every outside library of the project, in one place. Reasons: docs/dependencies.md.
find_package(Threads REQUIRED)
find_package(Eigen3 3.4 REQUIRED NO_MODULE)
if(EVPOSE_TESTS)
  find_package(GTest REQUIRED)
  find_package(Ceres 2 REQUIRED)  # what the solvers are compared with
  include(GoogleTest)
  enable_testing()
endif()
if(EVPOSE_ONLY STREQUAL tracker)  # needs nothing else
  return()
endif()

find_package(yaml-cpp REQUIRED)
find_package(PNG REQUIRED)
find_package(HDF5 REQUIRED COMPONENTS C)
find_package(BZip2 REQUIRED)
find_package(ZLIB REQUIRED)
find_package(SQLite3 REQUIRED)
foreach(library lz4 lzf zstd blosc)  # no CMake packages in Debian 12
  find_path(EVPOSE_${library}_INCLUDE ${library}.h PATH_SUFFIXES lib${library} REQUIRED)
  find_library(EVPOSE_${library}_LIBRARY ${library} REQUIRED)
  add_library(evpose_${library} INTERFACE)
  target_include_directories(evpose_${library} SYSTEM INTERFACE ${EVPOSE_${library}_INCLUDE})
  target_link_libraries(evpose_${library} INTERFACE ${EVPOSE_${library}_LIBRARY})
  set_target_properties(evpose_${library} PROPERTIES EXPORT_NAME ${library})
endforeach()
# CMake's own module gives HDF5 as variables in some releases and as targets in others: one name for both.
add_library(evpose_hdf5 INTERFACE)
target_include_directories(evpose_hdf5 SYSTEM INTERFACE ${HDF5_C_INCLUDE_DIRS})
target_link_libraries(evpose_hdf5 INTERFACE ${HDF5_C_LIBRARIES})
set_target_properties(evpose_hdf5 PROPERTIES EXPORT_NAME hdf5)
if(EVPOSE_ONLY)
  return()
endif()

find_package(nlohmann_json 3.9 REQUIRED)
find_package(CLI11 REQUIRED)
find_package(embree 3.12 REQUIRED)
find_package(assimp REQUIRED)
find_package(Boost 1.74 REQUIRED)  # headers alone
# Headers only; its own CMake file asks for more of them than Debian installs elsewhere.
find_path(EVPOSE_nanoflann_INCLUDE nanoflann.hpp REQUIRED)
add_library(evpose_nanoflann INTERFACE)
target_include_directories(evpose_nanoflann SYSTEM INTERFACE ${EVPOSE_nanoflann_INCLUDE})
if(EVPOSE_BENCHMARKS)
  find_package(benchmark REQUIRED)
endif()
