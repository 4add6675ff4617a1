"""How often each fact of a report came out so, in true reports at their places and in controls.

Written by ``benchmarks/fit_support.py``, measured on FARS reports of Virginia 2023 and of Arizona, California, Ohio and
South Dakota 2012 to 2016. A module and no file beside, so that a verdict's fingerprint covers it.
"""

COUNTS = """\
fact,agreement,true_count,true_of,chance_count,chance_of
alignment,agrees,82,91,306,450
alignment,near,4,91,80,450
alignment,differs,5,91,64,450
carriageways,agrees,9,9,15,48
carriageways,differs,0,9,33,48
compass direction,agrees,4,4,6,12
compass direction,differs,0,4,6,12
control,agrees,45,50,204,237
control,differs,5,50,33,237
course of the person,agrees,6,6,13,33
course of the person,differs,0,6,20,33
crash type,agrees,154,154,744,3082
crash type,differs,0,154,2338,3082
critical event,agrees,78,81,616,1613
critical event,differs,3,81,997,1613
damage,agrees,59,63,871,1267
damage,near,3,63,178,1267
damage,differs,1,63,218,1267
division,agrees,50,52,195,286
division,differs,2,52,91,286
first harmful event,agrees,79,79,1580,1580
first street,agrees,51,51,7,285
first street,near,0,51,6,285
first street,differs,0,51,272,285
impact,agrees,114,155,892,3103
impact,near,41,155,1135,3103
impact,differs,0,155,1076,3103
impact of the strike,agrees,38,41,315,450
impact of the strike,near,3,41,76,450
impact of the strike,differs,0,41,59,450
intersection,agrees,72,79,275,466
intersection,near,5,79,44,466
intersection,differs,2,79,147,466
land use,agrees,60,74,265,439
land use,near,4,74,42,439
land use,differs,10,74,132,439
lanes,agrees,56,63,177,279
lanes,differs,7,63,102,279
limit,agrees,38,43,54,159
limit,differs,5,43,105,159
manner of collision,agrees,78,78,973,1562
manner of collision,differs,0,78,589,1562
movement,agrees,104,104,1578,2065
movement,differs,0,104,487,2065
movement before the strike,agrees,24,24,221,247
movement before the strike,differs,0,24,26,247
point,agrees,72,79,414,466
point,near,7,79,41,466
point,differs,0,79,11,466
road class,agrees,48,78,167,457
road class,near,24,78,112,457
road class,differs,6,78,178,457
second street,agrees,35,36,8,227
second street,differs,1,36,219,227
speed before the strike,agrees,32,32,40,337
speed before the strike,differs,0,32,297,337
striking vehicle,agrees,38,38,441,441
travel speed,agrees,134,134,369,2680
travel speed,differs,0,134,2311,2680
zone of the person,agrees,38,38,438,441
zone of the person,differs,0,38,3,441
"""
