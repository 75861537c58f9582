# cmake -D SOURCE= -D BUILD= -D WORK= -D CXX= -D GENERATOR= -D VERSION= -P consumer_test.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\n${output}")
  endif()
  message(STATUS "${output}")
endfunction()

file(REMOVE_RECURSE ${WORK}/prefix)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)

# The installed program finds its scenarios by their names, wherever it was installed.
run(${WORK}/prefix/bin/evpose simulate landing --dump-config)

# Nothing of the tree that was built may be named in what was installed: it may be gone tomorrow.
file(GLOB_RECURSE package ${WORK}/prefix/*.cmake)
foreach(file IN LISTS package)
  file(READ ${file} text)
  foreach(word evpose_options march ${CMAKE_CURRENT_LIST_DIR})
    if(text MATCHES ${word})
      message(FATAL_ERROR "${file} names ${word}")
    endif()
  endforeach()
endforeach()
file(GLOB_RECURSE tests ${WORK}/prefix/*_test* ${WORK}/prefix/*/test_*)
if(tests)
  message(FATAL_ERROR "tests were installed: ${tests}")
endif()

# The project of a user, with what it asks of the package that is installed in a prefix.
function(build_project prefix components)
  file(REMOVE_RECURSE ${WORK}/project)
  run(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/project -B ${WORK}/project -G ${GENERATOR}
      -D CMAKE_CXX_COMPILER=${CXX} -D CMAKE_PREFIX_PATH=${prefix} -D EXPECTED_VERSION=${VERSION}
      -D COMPONENTS=${components} ${ARGN})
  run(${CMAKE_COMMAND} --build ${WORK}/project)
  run(${WORK}/project/consumer)
endfunction()

# Every package that the project looks for, but Eigen and threads, as if it were not installed.
file(READ ${SOURCE}/cmake/EvposeDependencies.cmake text)
file(READ ${SOURCE}/cmake/evpose-config.cmake.in config)
string(REGEX MATCHALL "find_(package|dependency)\\([A-Za-z0-9_-]+" packages "${text}${config}")
list(TRANSFORM packages REPLACE ".*\\(" "")
list(REMOVE_DUPLICATES packages)
list(REMOVE_ITEM packages Eigen3 Threads)
list(LENGTH packages count)
if(count LESS 10)
  message(FATAL_ERROR "only these packages were found to hide: ${packages}")
endif()
list(TRANSFORM packages REPLACE "(.+)" "-DCMAKE_DISABLE_FIND_PACKAGE_\\1=ON" OUTPUT_VARIABLE eigen_alone)

build_project(${WORK}/prefix "tracker\\;io")
build_project(${WORK}/prefix tracker ${eigen_alone})

# The tracker by itself, built and installed with nothing but Eigen.
file(REMOVE_RECURSE ${WORK}/tracker_prefix)
run(${CMAKE_COMMAND} -S ${SOURCE} -B ${WORK}/tracker -G ${GENERATOR} -D CMAKE_CXX_COMPILER=${CXX} -D EVPOSE_ONLY=tracker
    -D EVPOSE_UNITY=ON -D CMAKE_BUILD_TYPE=Debug ${eigen_alone})
run(${CMAKE_COMMAND} --build ${WORK}/tracker)
run(${CMAKE_COMMAND} --install ${WORK}/tracker --prefix ${WORK}/tracker_prefix)
build_project(${WORK}/tracker_prefix tracker ${eigen_alone})
