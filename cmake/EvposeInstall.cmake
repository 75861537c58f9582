# Installation: the libraries a program needs to read, track and judge, their headers, the program itself, and what
# find_package(evpose) wants. Component tracker: the modules from core to tracker. Component io: files and measures.
# Each install component is a Debian package (cmake/EvposePackages.cmake): program, development, python.
include(CMakePackageConfigHelpers)
set(CMAKE_INSTALL_DEFAULT_COMPONENT_NAME development)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/evpose)
function(evpose_install export)
  foreach(module IN LISTS ARGN)
    install(TARGETS evpose_${module} EXPORT ${export})
    install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/evpose/${module} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/evpose
            FILES_MATCHING PATTERN "*.h" PATTERN "test_*.h" EXCLUDE)
  endforeach()
  install(EXPORT ${export} NAMESPACE evpose:: DESTINATION ${config_dir})
endfunction()

install(TARGETS evpose_eigen EXPORT evposeTrackerTargets)
evpose_install(evposeTrackerTargets core camera imu event map registration relocalization fusion tracker)
if(TARGET evpose_eval)
  foreach(room files hdf5 events bags calibration motion maps formats recording)
    install(TARGETS evpose_io_${room} EXPORT evposeIoTargets)
  endforeach()
  install(TARGETS evpose_hdf5 evpose_lz4 evpose_lzf evpose_zstd evpose_blosc EXPORT evposeIoTargets)
  evpose_install(evposeIoTargets io eval)
endif()
if(TARGET evpose)
  install(TARGETS evpose COMPONENT program)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/scenarios DESTINATION ${CMAKE_INSTALL_DATADIR}/evpose COMPONENT program)
  install(FILES ${PROJECT_SOURCE_DIR}/web/foxglove/evpose.json DESTINATION ${CMAKE_INSTALL_DATADIR}/evpose/foxglove
          COMPONENT program)
endif()

configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/evpose-config.cmake.in
                              ${PROJECT_BINARY_DIR}/evpose-config.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/evpose-config-version.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/evpose-config.cmake ${PROJECT_BINARY_DIR}/evpose-config-version.cmake
        DESTINATION ${config_dir})
