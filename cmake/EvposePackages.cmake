# Debian packages of what is installed, one for each install component: `cpack -G DEB` in a build of the preset package
# (scripts/make_debs.sh). What the program and the Python module link is asked of dpkg-shlibdeps; what the static
# libraries want from their users is what cmake/evpose-config.cmake.in looks for.
set(CPACK_GENERATOR DEB)
set(CPACK_PACKAGE_NAME evpose)
set(CPACK_PACKAGE_DESCRIPTION_SUMMARY "")  # each has its own
set(CPACK_PACKAGE_CONTACT "the evpose authors <authors@evpose.invalid>")
set(CPACK_COMPONENTS_ALL program development)
if(TARGET evpose_python)
  list(APPEND CPACK_COMPONENTS_ALL python)
endif()
set(CPACK_INSTALL_DEFAULT_DIRECTORY_PERMISSIONS
    OWNER_READ OWNER_WRITE OWNER_EXECUTE GROUP_READ GROUP_EXECUTE WORLD_READ WORLD_EXECUTE)
set(CPACK_STRIP_FILES ON)
set(CPACK_DEB_COMPONENT_INSTALL ON)
set(CPACK_DEBIAN_FILE_NAME DEB-DEFAULT)
set(CPACK_DEBIAN_COMPRESSION_TYPE xz)

set(CPACK_DEBIAN_PROGRAM_PACKAGE_NAME evpose)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SECTION science)
set(CPACK_DEBIAN_PROGRAM_PACKAGE_SHLIBDEPS ON)
set(CPACK_COMPONENT_PROGRAM_DESCRIPTION "6-DoF pose from an event camera and an IMU against a prior 3D map
The program evpose: builds maps of contours from point clouds, tracks recordings
and live cameras against them, judges trajectories, simulates flights.")

set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_NAME libevpose-dev)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_SECTION libdevel)
set(CPACK_DEBIAN_DEVELOPMENT_PACKAGE_DEPENDS "libeigen3-dev (>= 3.4), libbz2-dev, libblosc-dev, libhdf5-dev, liblz4-dev,\
 liblzf-dev, libpng-dev, libsqlite3-dev, libyaml-cpp-dev, libzstd-dev, zlib1g-dev")
set(CPACK_COMPONENT_DEVELOPMENT_DESCRIPTION "tracker of evpose as a library, its headers and CMake package
Static libraries for find_package(evpose) and evpose::tracker, evpose::io.")

set(CPACK_DEBIAN_PYTHON_PACKAGE_NAME python3-evpose)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SECTION python)
set(CPACK_DEBIAN_PYTHON_PACKAGE_SHLIBDEPS ON)
set(CPACK_DEBIAN_PYTHON_PACKAGE_DEPENDS "${EVPOSE_PYTHON_DEPENDS}, python3-numpy")
set(CPACK_COMPONENT_PYTHON_DESCRIPTION "tracker of evpose as a Python module
Events and IMU samples as numpy arrays in, poses out.")

# evpose_document(COMPONENT PACKAGE FILE...): what lies in the package's folder of documentation, with its licence.
function(evpose_document component package)
  install(FILES ${PROJECT_SOURCE_DIR}/cmake/copyright ${ARGN} COMPONENT ${component}
          DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/${package})
endfunction()
evpose_document(program evpose ${PROJECT_SOURCE_DIR}/README.md)
install(DIRECTORY ${PROJECT_SOURCE_DIR}/docs DESTINATION ${CMAKE_INSTALL_DATADIR}/doc/evpose COMPONENT program
        PATTERN "*.py" EXCLUDE)
evpose_document(development libevpose-dev ${PROJECT_SOURCE_DIR}/tests/consumer/project/follow.cpp)
if(TARGET evpose_python)
  evpose_document(python python3-evpose ${PROJECT_SOURCE_DIR}/python/example.py)
endif()
include(CPack)
