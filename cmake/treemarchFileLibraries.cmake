# The libraries behind treemarch_io, for the build and for those who link the installed library.
# Debian's GDCM package names tools of packages that need not be there, and says so at length: only errors are shown.
set(treemarch_log_level "${CMAKE_MESSAGE_LOG_LEVEL}")
set(CMAKE_MESSAGE_LOG_LEVEL ERROR)
find_package(ITK 5.2 REQUIRED COMPONENTS ITKCommon ITKIOImageBase ITKIOGDCM ITKGDCM)
set(CMAKE_MESSAGE_LOG_LEVEL "${treemarch_log_level}")
find_package(HDF5 REQUIRED COMPONENTS C)
find_library(DEFLATE_LIBRARY deflate REQUIRED)
find_library(METIS_LIBRARY metis REQUIRED)
find_package(PNG REQUIRED)
find_package(TIFF REQUIRED)
find_package(ZLIB REQUIRED)
find_package(pugixml REQUIRED)
