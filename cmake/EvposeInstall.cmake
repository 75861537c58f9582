# Installation: the libraries a program needs to read, track and judge, their headers, the program itself, and what
# find_package(evpose) wants.
include(CMakePackageConfigHelpers)

set(config_dir ${CMAKE_INSTALL_LIBDIR}/cmake/evpose)
set(installed_modules core camera imu event map registration fusion tracker io eval)
set(installed_io_rooms files hdf5 events bags calibration motion maps formats recording)
foreach(module IN LISTS installed_modules)
  if(NOT TARGET evpose_${module})
    continue()
  endif()
  install(TARGETS evpose_${module} EXPORT evposeTargets)
  install(DIRECTORY ${PROJECT_SOURCE_DIR}/src/evpose/${module} DESTINATION ${CMAKE_INSTALL_INCLUDEDIR}/evpose
          FILES_MATCHING PATTERN "*.h" PATTERN "test_*.h" EXCLUDE)
endforeach()
foreach(room IN LISTS installed_io_rooms)
  install(TARGETS evpose_io_${room} EXPORT evposeTargets)
endforeach()
install(TARGETS evpose_eigen evpose_hdf5 evpose_lz4 evpose_zstd evpose_blosc EXPORT evposeTargets)
if(TARGET evpose)
  install(TARGETS evpose)
endif()

install(EXPORT evposeTargets NAMESPACE evpose:: DESTINATION ${config_dir})
configure_package_config_file(${PROJECT_SOURCE_DIR}/cmake/evpose-config.cmake.in
                              ${PROJECT_BINARY_DIR}/evpose-config.cmake INSTALL_DESTINATION ${config_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/evpose-config-version.cmake
                                 COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/evpose-config.cmake ${PROJECT_BINARY_DIR}/evpose-config-version.cmake
        DESTINATION ${config_dir})
