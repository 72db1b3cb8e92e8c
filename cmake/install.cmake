# Headers, libraries and a package for find_package(treemarch [COMPONENTS io]).
include(CMakePackageConfigHelpers)

install(DIRECTORY src/treemarch DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h")
install(TARGETS treemarch EXPORT treemarchTargets)
install(TARGETS treemarch_io EXPORT treemarchIoTargets)
install(TARGETS treemarch_dicom LIBRARY DESTINATION ${CMAKE_INSTALL_LIBDIR}/treemarch)
if(TREEMARCH_BUILD_APPS)
  set_target_properties(treemarch_app PROPERTIES INSTALL_RPATH $ORIGIN/../${CMAKE_INSTALL_LIBDIR}/treemarch)
  install(TARGETS treemarch_app RUNTIME DESTINATION ${CMAKE_INSTALL_BINDIR})
endif()

# Two export sets, so that users of the algorithms alone need no file library.
set(package_dir ${CMAKE_INSTALL_LIBDIR}/cmake/treemarch)
install(EXPORT treemarchTargets NAMESPACE treemarch:: DESTINATION ${package_dir})
install(EXPORT treemarchIoTargets NAMESPACE treemarch:: DESTINATION ${package_dir})
configure_package_config_file(cmake/treemarchConfig.cmake.in ${PROJECT_BINARY_DIR}/treemarchConfig.cmake
                              INSTALL_DESTINATION ${package_dir})
write_basic_package_version_file(${PROJECT_BINARY_DIR}/treemarchConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/treemarchConfig.cmake ${PROJECT_BINARY_DIR}/treemarchConfigVersion.cmake
              cmake/treemarchFileLibraries.cmake
        DESTINATION ${package_dir})
