# cmake -D BUILD= -D WORK= -D CXX= -D GENERATOR= -D VERSION= -P consumer_test.cmake
function(run)
  execute_process(COMMAND ${ARGN} RESULT_VARIABLE status OUTPUT_VARIABLE output ERROR_VARIABLE output)
  if(NOT status EQUAL 0)
    list(JOIN ARGN " " command)
    message(FATAL_ERROR "${command}\n${output}")
  endif()
  message(STATUS "${output}")
endfunction()

file(REMOVE_RECURSE ${WORK}/prefix ${WORK}/project)
run(${CMAKE_COMMAND} --install ${BUILD} --prefix ${WORK}/prefix)

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

run(${CMAKE_COMMAND} -S ${CMAKE_CURRENT_LIST_DIR}/project -B ${WORK}/project -G ${GENERATOR}
    -D CMAKE_CXX_COMPILER=${CXX} -D CMAKE_PREFIX_PATH=${WORK}/prefix -D EXPECTED_VERSION=${VERSION})
run(${CMAKE_COMMAND} --build ${WORK}/project)
run(${WORK}/project/consumer)
